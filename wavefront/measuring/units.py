"""The units of measurements."""

UNITS = {
    "irradiance": "W·m⁻²",
    "fluence": "W·m⁻²",
    "radiance": "W·sr⁻¹·m⁻²",
    "arriving flux": "W",
    "leaving flux": "W",
}
# the name of `lux` in tables, and its unit
PHOTOMETRIC = {
    "irradiance": ("lux", "lux"),
    "fluence": ("lux", "lux"),
    "radiance": ("luminance", "cd·m⁻²"),
    "arriving flux": ("lumens", "lm"),
    "leaving flux": ("lumens", "lm"),
}
