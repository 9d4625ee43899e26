"""Types of pbrt-v2 and pbrt-v3, as the nearest ones of pbrt-v4.

Source: pbrt.org, "pbrt-v3 Input File Format" and "pbrt-v2 Input File Format".
"""

from __future__ import annotations

from ..description.entity import Entity
from .entities import TABLE, retype

COLORS = ("reflectance", "Kd", "color", "Kr", "albedo")  # parameters of materials
SHAPES = ("cone", "paraboloid", "hyperboloid", "nurbs", "heightfield")
# by kind and type: the nearest type, and its names of parameters; None: there is none
OLDER: dict[tuple[str, str], tuple[str | None, dict[str, str]]] = {
    ("material", "matte"): ("diffuse", {"Kd": "reflectance", "bumpmap": "displacement"}),
    **{
        ("material", name): ("coateddiffuse", {"Kd": "reflectance", "bumpmap": "displacement"})
        for name in ("plastic", "substrate", "uber", "shinymetal")
    },
    ("material", "glass"): ("dielectric", {"index": "eta", "bumpmap": "displacement"}),
    ("material", "mirror"): ("conductor", {"Kr": "reflectance", "bumpmap": "displacement"}),
    ("material", "metal"): ("conductor", {"bumpmap": "displacement"}),
    ("material", "translucent"): ("diffusetransmission", {"Kd": "reflectance"}),
    ("material", "disney"): ("diffuse", {"color": "reflectance"}),
    ("material", "kdsubsurface"): ("diffuse", {"Kd": "reflectance"}),
    ("material", "fourier"): ("diffuse", {}),
    ("film", "image"): ("rgb", {}),
    ("camera", "environment"): ("spherical", {}),
    ("area light", "area"): ("diffuse", {}),
    **{
        ("sampler", name): ("independent", {})
        for name in ("lowdiscrepancy", "02sequence", "random", "maxmindist", "bestcandidate", "adaptive")
    },
    **{("integrator", name): ("path", {}) for name in ("directlighting", "whitted", "exphotonmap")},
    **dict.fromkeys([("shape", name) for name in SHAPES], (None, {})),
}


def upgrade(entity: Entity) -> None:
    """Give an entity of an older version, or a material that is unknown, the nearest type, which is noted."""
    kind, known = entity.kind, (entity.kind, entity.type) in TABLE.makers
    if known and kind != "light":
        return
    nearest, names = OLDER.get((kind, entity.type), (None, {}))
    color_name = next((name for name in COLORS if name in entity.values), None)
    if (kind, entity.type) in OLDER:
        done = f"as {nearest!r}" if nearest else "left out"
        entity.lose(f"is of pbrt-v3 or older, and this reads pbrt-v4; {done}")
    elif kind == "material" and not known and color_name is not None:
        entity.lose("pbrt has no such material; a diffuse surface of its color in its place")
        nearest, names = "diffuse", {color_name: "reflectance"}
    elif kind == "camera" and not known:
        entity.lose("pbrt has no such camera; 'perspective' in its place")
        nearest = "perspective"
    elif kind == "light" and "mapname" in entity.values:
        entity.lose("mapname is of pbrt-v3, and this reads pbrt-v4; as filename")
        names = {"mapname": "filename"}
    retype(entity, nearest or entity.type)
    for old, new in names.items():
        entity.rename(old, new)
