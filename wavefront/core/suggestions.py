"""Suggestions for unknown names: "did you mean"."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Sequence
from difflib import get_close_matches
from functools import wraps
from typing import ParamSpec, TypeVar

P = ParamSpec("P")
R = TypeVar("R")

COLORS = ("reflectance", "base_color", "intensity", "irradiance", "radiance", "colors")

# Names in other programs, in lower case without underscores, and the names here. The first one that is known
# where the name was used is suggested.
SYNONYMS: dict[str, tuple[str, ...]] = {
    "albedo": ("reflectance", "base_color"),
    "at": ("target",),
    "basecolor": ("reflectance",),
    "bounces": ("max_bounces",),
    "center": ("position", "origin", "target"),
    "centre": ("center", "position", "origin"),
    "color": (*COLORS, "material", "emission"),
    "colour": (*COLORS, "material", "emission"),
    "depth": ("max_bounces",),
    "diffuse": ("reflectance", "base_color"),
    "emit": ("emission",),
    "emissive": ("emission",),
    "energy": ("intensity", "irradiance", "radiance"),
    "environment": ("lighting",),
    "eta": ("ior",),
    "eye": ("origin",),
    "fieldofview": ("fov",),
    "fovy": ("fov",),
    "from": ("origin",),
    "indexofrefraction": ("ior",),
    "indices": ("faces",),
    "intensity": ("irradiance", "radiance"),
    "intior": ("ior",),
    "irradiance": ("intensity", "radiance"),
    "kd": ("reflectance", "base_color"),
    "location": ("position", "origin", "center"),
    "lookat": ("target",),
    "lookfrom": ("origin",),
    "maxdepth": ("max_bounces",),
    "method": ("integrator",),
    "njobs": ("workers",),
    "nsamples": ("spp",),
    "numsamples": ("spp",),
    "numthreads": ("workers",),
    "pixels": ("rgb",),
    "pos": ("position", "origin", "center"),
    "position": ("origin", "center"),
    "power": ("intensity", "irradiance", "radiance"),
    "quality": ("spp",),
    "r": ("radius",),
    "radiance": ("emission", "intensity", "irradiance"),
    "resolution": ("size",),
    "samplecount": ("spp",),
    "samples": ("spp",),
    "samplesperpixel": ("spp",),
    "strength": ("intensity", "irradiance", "radiance"),
    "texcoords": ("uvs",),
    "threads": ("workers",),
    "time": ("seconds",),
    "timelimit": ("seconds",),
    "timeout": ("seconds",),
    "tint": ("transmittance", "reflectance", "base_color"),
    "triangles": ("faces",),
    "uv": ("uvs",),
    "vertexcolors": ("colors",),
    "vertexnormals": ("normals",),
    "verts": ("vertices",),
    "vfov": ("fov",),
    "width": ("size",),
    "yfov": ("fov",),
    "arealight": ("Rectangle",),
    "box": ("Mesh",),
    "cube": ("Mesh",),
    "dome": ("Environment",),
    "envmap": ("Environment",),
    "environmentlight": ("Environment",),
    "glass": ("Dielectric",),
    "halton": ("sobol",),
    "lambertian": ("Diffuse",),
    "metal": ("Conductor",),
    "path": ("full",),
    "pathtracer": ("full",),
    "pbr": ("Principled",),
    "perspectivecamera": ("Camera",),
    "plane": ("Rectangle",),
    "plastic": ("Principled",),
    "quad": ("Rectangle",),
    "random": ("independent",),
    "sun": ("DirectionalLight",),
    "triangle": ("Mesh",),
    "trianglemesh": ("Mesh",),
}


# What is looked for on a BSDF and belongs to a material, by keyword or attribute, and what to write.
MATERIAL_ARGUMENTS: dict[str, str] = {
    "absorption": "wf.Material(bsdf, interior=wf.Medium(absorption=...))",
    "alpha": "wf.Material(bsdf, alpha=...)",
    "alpha_cutoff": "wf.Material(bsdf, alpha=..., alpha_cutoff=...)",
    "emission": "wf.Material(bsdf, emission=...)",
    "interior": "wf.Material(bsdf, interior=...)",
    "normal_map": "wf.Material(bsdf, normal_map=...)",
    "opacity": "wf.Material(bsdf, alpha=...)",
    "visible_to_camera": "wf.Material(bsdf, visible_to_camera=...)",
    "with_alpha": "wf.Material(bsdf, alpha=...)",
    "with_normal_map": "wf.Material(bsdf, normal_map=...)",
}


def meant(name: str, known: Iterable[str]) -> str | None:
    """Return the known name of which `name` is a synonym or a misspelling; None if there is none."""
    plain = {_plain(other): other for other in known}
    word = _plain(name)
    if word in plain:
        return plain[word]
    for synonym in SYNONYMS.get(word, ()):
        if _plain(synonym) in plain:
            return plain[_plain(synonym)]
    close = get_close_matches(word, plain, 1, 0.66 if len(word) < 4 else 0.7)  # one letter of three
    return plain[close[0]] if close else None


def did_you_mean(name: object, known: Iterable[str]) -> str:
    """Return "; did you mean 'x'?" for an unknown name, or "" where no known name is similar."""
    found = meant(name, known) if isinstance(name, str) else None
    return "" if found is None else f"; did you mean {found!r}?"


def suggests_keywords(function: Callable[P, R]) -> Callable[P, R]:
    """Let a function suggest a known keyword argument for an unknown one.

    The error is a TypeError, as in Python, and the signature is that of the function. A class may have
    `given_elsewhere`: for keywords that belong to another class, what to write.
    """
    code = function.__code__
    known = code.co_varnames[: code.co_argcount + code.co_kwonlyargcount]

    @wraps(function)
    def checked(*args: P.args, **kwargs: P.kwargs) -> R:
        check_keywords(function, known, args, kwargs)
        return function(*args, **kwargs)

    return checked


def check_keywords(
    function: Callable[..., object], known: Collection[str], args: Sequence[object], names: Iterable[str]
) -> None:
    """Check the names of keyword arguments, given those that are known and the positional arguments.

    Raises
    ------
    TypeError
        If one is unknown, as in Python.
    """
    for name in names:
        if name not in known:
            makes = function.__name__ == "__init__"
            elsewhere = getattr(args[0], "given_elsewhere", {}) if args else {}
            hint = did_you_mean(name, known)
            if name in elsewhere and (makes or not hint):
                hint = f"; write {elsewhere[name]}"
            title = type(args[0]).__name__ if makes else function.__qualname__
            raise TypeError(f"{title}() got an unexpected keyword argument {name!r}{hint}")


def _plain(name: str) -> str:
    return name.lower().replace("_", "")
