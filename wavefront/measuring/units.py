"""The units of what sensors measure."""

UNITS = {
    "irradiance": "W·m⁻²",
    "fluence": "W·m⁻²",
    "radiance": "W·sr⁻¹·m⁻²",
    "arriving flux": "W",
    "leaving flux": "W",
}
# what `lux` is called in tables, and its unit
PHOTOMETRIC = {
    "irradiance": ("lux", "lux"),
    "fluence": ("lux", "lux"),
    "radiance": ("luminance", "cd·m⁻²"),
    "arriving flux": ("lumens", "lm"),
    "leaving flux": ("lumens", "lm"),
}
