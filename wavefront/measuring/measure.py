"""measure(): a render whose pixels are sensors."""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy
from typing import Any, Unpack

from numpy.typing import ArrayLike

from ..camera import Sensors
from ..core.errors import SceneError
from ..drive import Session
from ..drive.render import finish
from ..film.aov_names import chosen_aovs
from ..io.to_scene import as_scene
from ..scene import Scene
from ..settings import AUTO, RenderSettings, refuse, takes_settings
from .measurement import Measurement

PLACES = "sensors are at the points that are given"
PIXELS = "each sensor is a place of its own, and no picture"
REFUSED = dict.fromkeys(("camera", "size", "view", "fov"), PLACES) | {"background": PIXELS, "denoise": PIXELS}
LAYERS = ("direct", "indirect", "light_groups")


@takes_settings
def measure(
    scene: Any,
    points: ArrayLike,
    normals: ArrayLike | None = None,
    *,
    kind: str = "irradiance",
    spp: int | None = None,
    **settings: Unpack[RenderSettings],
) -> Measurement:
    """Measure the light that arrives at points, with its standard error.

    Parameters
    ----------
    scene
        As for `render`. Only its own light counts, unless `lighting` names a preset.
    points
        (n, 3) where the sensors are, scene units. A point on a surface is on the side that its normal points
        to: sensors of irradiance are moved along their normals by a four-millionth of the scene's size.
        Sensors cast no shadow.
    normals
        (n, 3), or (3,) for all points, of any length: the normals of the plane that irradiance falls on, or,
        for radiance, the directions in which the sensors look. None for fluence.
    kind
        "irradiance", ∫ L cosθ dω over the hemisphere of the normal, W·m⁻²; "fluence", ∫ L dω over all
        directions alike, W·m⁻² (the fluence rate, also known as scalar or spherical irradiance); "radiance",
        L from one direction, W·sr⁻¹·m⁻².
    spp
        Samples per point, as for `render`.
    noise
        Measure until the estimated relative error of every point is at most this: 0.01 means 1 %. Points with
        less than a tenth of the mean of all points count as if they had that much.
    max_bounces
        The most scattering events along a path in the scene: with 0 light arrives from lights alone.
    reuse
        Whether points share paths: what the path of one finds from the first surface on counts for sixteen
        points that lie near each other. It pays where most noise is in indirect light between matte surfaces.
        Errors of such points depend on each other. By default a short tuning run decides.
    aovs
        "direct", "indirect" and "light_groups", to have these parts apart.
    {settings}

    Returns
    -------
    Measurement

    Raises
    ------
    SceneError
        If an argument or the scene is malformed, or a setting is one of pictures.
    Interrupted, RenderError
        As for `render`. `Measurement(error.image)` is what was measured so far, if there is an image.

    Examples
    --------
    >>> scene = wf.Scene([wf.Sphere((0, 0, 3), 0.5, emission=2)])
    >>> found = wf.measure(scene, [(0, 0, 0), (1, 0, 0)], normals=(0, 0, 1), spp=64)
    >>> found.value.shape, found.standard_error.shape, found.samples.tolist()
    ((2, 3), (2, 3), [64, 64])
    >>> low, high = found.interval(0.95)
    >>> exact = 2 * np.pi * (0.5 / 3) ** 2
    >>> bool(abs(found.value[0, 0] - exact) < 0.01 * exact)
    True
    """
    subject = as_scene(
        scene, settings.get("material"), settings.get("progress"), settings.get("smooth", AUTO)
    )
    return measured(subject, Sensors(points, normals, kind).above(subject.bounds), spp, settings)


def measured(
    scene: Scene,
    sensors: Sensors,
    spp: int | None,
    settings: Mapping[str, Any],
    command: dict[str, Any] | None = None,
) -> Measurement:
    """Return the measurement by sensors in a scene; settings as of `measure`, `command` for checkpoints."""
    subject = copy(scene)
    subject.settings = {name: value for name, value in scene.settings.items() if name not in REFUSED}
    session = Session(subject, spp, **sensor_settings(settings, sensors), camera=sensors)
    session.command = command
    return Measurement(finish(session))


def sensor_settings(settings: Mapping[str, Any], sensors: Sensors) -> dict[str, Any]:
    """Return settings of a render for sensors.

    Raises
    ------
    SceneError
        If one of them is for pictures only.
    """
    if settings.get("caustics") is True:
        raise SceneError("caustics is True; paths from lights reach no point")
    if settings.get("reuse") is True and not sensors.may_share:
        raise SceneError("reuse is True; power on shapes is measured without it")
    refuse({name: value for name, value in settings.items() if value is not False}, REFUSED)
    aovs = chosen_aovs("aovs", settings.get("aovs", ()))
    for name in aovs:
        if name not in LAYERS:
            raise SceneError(f"aovs has {name!r}; sensors have {', '.join(LAYERS)}")
    lighting = settings.get("lighting", AUTO)
    fixed = {"caustics": False, "denoise": False, "filter": "box", "ground": False}
    if not sensors.may_share:
        fixed["reuse"] = False
    return {**settings, **fixed, "aovs": aovs, "lighting": None if lighting == AUTO else lighting}
