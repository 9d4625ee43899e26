"""A scene that is ready to be rendered from any view, and whether the light of its file lights it."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import fields, replace
from functools import cached_property, partial
from typing import Any

import numpy as np

from ..accel import Accelerator, AcceleratorCache, Geometry, InstanceAccelerator, most_copies
from ..aovs.flow import Flow
from ..aovs.geometric import ShapeTable, geometric_aovs
from ..arrays.vec import luminance
from ..camera import Camera
from ..codecs.tone import CHOSEN_TONE
from ..compile.scene import CompiledScene
from ..core.errors import SceneError, collect_warnings, warn_caller
from ..core.fingerprint import fingerprint
from ..core.progress import phase
from ..features.compiling import compile_scene
from ..integrators import INTEGRATORS, WITH_MIS
from ..lights import DirectionalLight, Environment, Sky
from ..media import Medium
from ..motion.shutter import Shutter
from ..scene import Scene
from ..scene.lighting import DEFAULT, choose_ground, choose_preset, is_above, lighted
from ..settings import AUTO, Settings
from ..settings.checks import MEDIA, MOVING_IN_TURN, ROLLING, check_combinations


class PreparedScene:
    """A user's scene with the light and ground that settings add to it, compiled.

    Parameters
    ----------
    scene
        The user's.
    settings
        Of the render.
    camera
        Of the render.
    framed
        The camera, if it was made to frame the scene.

    Attributes
    ----------
    scene
        The user's.
    preset
        Name of the light that was added; None if there is none.
    light_is_chosen
        Whether that light was chosen automatically.
    tone
        Name of the tone curve that the light was chosen for; "none" for lights of one's own.
    ground
        Whether a ground was added; "shadow" for one of which only the shadow is seen.
    lighted
        The scene with both.
    compiled
        That one, compiled.
    shapes
        Names and ids of its shapes.
    """

    def __init__(self, scene: Scene, settings: Settings, camera: Camera, framed: Camera | None) -> None:
        self.scene, self._camera, self._geometries = scene, camera, list[Geometry]()
        self._framed = framed is not None
        self._span = _exposed_for(scene, settings, camera)
        self._fingerprint: str | None = None
        self._light(settings, camera, framed)
        if settings.values["integrator"] == "naive":
            _warn_of_unseen_lights(self.lighted)
        _warn_of_light_in_endless_fog(self.lighted)
        with phase("building the scene", settings.values["progress"]):
            compiled = self._compile(settings)
        scatters = compiled.media is not None and not compiled.media.only_absorbs
        rolls = self._span is not None and camera.rolling_shutter != 0
        in_turn = rolls and compiled.motion is not None
        check_combinations({**settings.values, MEDIA: scatters, MOVING_IN_TURN: in_turn, ROLLING: rolls})
        self.compiled = replace(compiled, roulette_after=settings.roulette_after)
        self.shapes = ShapeTable(self.lighted.shapes)

    def _light(self, settings: Settings, camera: Camera, framed: Camera | None) -> None:
        """Add the light and the ground that settings ask for."""
        scene, values = self.scene, settings.values
        self.preset, up = choose_preset(scene, values["lighting"]), scene.vertical(values["up"])
        if values["lighting"] == AUTO and self.preset is None and needs_preset(scene, settings, camera):
            self.preset = DEFAULT
        chosen = self.light_is_chosen = values["lighting"] == AUTO and self.preset is not None
        self.tone = CHOSEN_TONE if chosen else "none"
        above = is_above(scene, camera, framed is not None, up)
        self.ground = choose_ground(values["ground"], chosen, above, values["background"])
        self.lighted = lighted(scene, self.preset, ground=self.ground, up=up, camera=framed)

    def suits(self, camera: Camera | None, settings: Settings) -> bool:
        """Return whether light and ground are those for another camera; None is one that frames the scene."""
        if (camera is None) != self._framed or self.scene.has_lights_of_file:
            return False
        above = camera is None or is_above(
            self.scene, camera, False, self.scene.vertical(settings.values["up"])
        )
        choice = settings.values["ground"], self.light_is_chosen, above, settings.values["background"]
        return camera is None or choose_ground(*choice) == self.ground

    def _compile(self, settings: Settings) -> CompiledScene:
        """Compile the scene, and note the geometries of its accelerators."""
        values = settings.values
        make_accelerator = self.scene.accelerators.maker(values["accel"])

        def make(geometry: Geometry) -> Accelerator:
            self._geometries.append(geometry)
            return make_accelerator(geometry)

        return compile_scene(
            self.lighted,
            make,
            values["light_sampler"],
            most_copies(values["accel"]),
            mis=INTEGRATORS.find(values["integrator"]) in WITH_MIS,
            caustics=values["caustics"],
            asked={
                "background": settings.background_color,
                "features": values["features"],
                "shutter": self._span,
            },
        )

    def check_camera(self, camera: Camera) -> None:
        """Check that another camera can see the compiled scene.

        Raises
        ------
        SceneError
            If it is too far away, or its sensor is read more slowly than that of the first camera.
        """
        self.compiled.view(camera)
        if self._span is not None and abs(camera.rolling_shutter) > abs(self._camera.rolling_shutter):
            raise SceneError(
                f"Camera rolling_shutter is {camera.rolling_shutter:g}; this scene was compiled for at most "
                f"{abs(self._camera.rolling_shutter):g} s, those of the first camera"
            )

    def flow(self, camera: Camera, settings: Settings) -> Flow:
        """Return the optical flow of a camera's picture to those before and after.

        Raises
        ------
        SceneError
            If a shape is left out of this moment, as it has no size then.
        """
        whole, count = self.scene.whole, len(self.scene.shapes)
        if len(whole.shapes) != count:
            raise SceneError(
                f"at {self.scene.moment:g} s a shape has no size; flow needs a scene with all its shapes"
            )
        shutter, times = settings.shutter, settings.values["flow_times"]
        assert times is not None
        start = whole.start if self.scene.moment is None else self.scene.moment
        shapes = [*whole.shapes, *self.lighted.shapes[count:]]
        at = partial(self._surfaces_at, whole, camera.rolling_shutter, settings.values["accel"])
        return Flow(shapes, camera.over_time, start if shutter is None else shutter.middle, times, at)

    def _surfaces_at(self, whole: Scene, read: float, accel: Any, time: float) -> CompiledScene:
        """Return the surfaces that there are at a time, and while a sensor is read from then on, s."""
        moment = copy(whole if read else whole.at(time))
        moment.shapes = [*moment.shapes, *self.lighted.shapes[len(self.scene.shapes) :]]
        moment.lights = []
        span = Shutter(time, time + abs(read)) if read else None
        return compile_scene(moment, AcceleratorCache().maker(accel), asked={"shutter": span})

    @cached_property
    def subject_part(self) -> float:
        """Part of the picture that the shapes of the user's scene fill, by rays through 32 × 32 points."""
        layers = geometric_aovs(self.compiled, self._camera.replace(size=32), self.shapes, ("shape_id",))
        ids = layers["shape_id"]
        return float(((ids >= 0) & (ids < len(self.scene.shapes))).mean())

    def fingerprint(self) -> str:
        """Return the fingerprint of all that rays can meet.

        Raises
        ------
        SceneError
            If a part of it, such as an attribute of a BSDF of a user, cannot be compared.
        """
        if self._fingerprint is None:
            self._fingerprint = scene_fingerprint(self.compiled, self._geometries)
        return self._fingerprint


def _exposed_for(scene: Scene, settings: Settings, camera: Camera) -> Shutter | None:
    """Return the shutter, open for as long as any row of a camera is exposed.

    Raises
    ------
    SceneError
        If the camera has a rolling shutter, something moves, and no shutter is given.
    """
    if settings.shutter is not None:
        return settings.shutter.read_over(camera.rolling_shutter)
    if camera.rolling_shutter and (camera.moves or scene.moves):
        raise SceneError(
            f"Camera rolling_shutter is {camera.rolling_shutter:g}, and something moves; "
            "shutter=(open, close) says when its first row is exposed"
        )
    return None


def scene_fingerprint(compiled: CompiledScene, geometries: Sequence[Geometry]) -> str:
    """Return the fingerprint of a compiled scene and of the geometries of its accelerators.

    Raises
    ------
    SceneError
        If a part of it, such as an attribute of a user's BSDF, cannot be compared.
    """
    parts = {field.name: getattr(compiled, field.name) for field in fields(compiled)}
    accelerator, program = parts.pop("accelerator"), parts.pop("program")
    parts["features"] = [feature for feature in program.features if feature.compared]
    del parts["specular_surfaces"]  # they follow from the rest, and the setting is compared by itself
    if compiled.media is not None:
        parts["media"] = replace(compiled.media, touching=None)  # likewise
    del parts["roulette_after"]  # a setting, which is compared by itself
    placements = accelerator.placements if isinstance(accelerator, InstanceAccelerator) else None
    return fingerprint("the scene", {**parts, "geometries": list(geometries), "placements": placements})


def _warn_of_light_in_endless_fog(scene: Scene) -> None:
    """Warn of lights at infinity that do not get through the medium of a scene."""
    far = any(isinstance(light, Environment | DirectionalLight) for light in scene.lights)
    if far and isinstance(scene.medium, Medium) and (scene.medium.sigma_a + scene.medium.sigma_s).all():
        warn_caller(
            "the scene's medium has no end, so no light of an Environment or a DirectionalLight gets "
            "through; a large box of wf.NullSurface() with this interior has one"
        )


def _warn_of_unseen_lights(scene: Scene) -> None:
    """Warn of lights that the naive integrator cannot find."""
    kinds = ", ".join(sorted({type(light).__name__ for light in scene.lights if light.delta}))
    if kinds:
        warn_caller(f"the naive integrator cannot find lights without size ({kinds})")


SIDE, SPP = 64, 4  # of the pictures that are compared
LITTLE = 0.02  # of the light of the preset


def needs_preset(scene: Scene, settings: Settings, camera: Camera) -> bool:
    """Return whether the own light of a scene that was read from a file leaves it black, and say so.

    Two small pictures are compared, of its own light and of the default preset alone, always with the same
    seed. What counts is the median of what the camera sees. Scenes that are made in Python, those with an
    `Environment` or a `Sky`, and those in a medium are left as they are.
    """
    if not scene.has_lights_of_file or scene.medium is not None or camera.sensor is not None:
        return False
    if not scene.emits or any(isinstance(light, Environment | Sky) for light in scene.lights):
        return False
    own, usual = (_median(lit, settings, camera) for lit in (scene, _unlit(scene, settings, camera)))
    if not usual or not own < LITTLE * usual:
        return False
    share = f"{100 * own / usual:.2g} % of the light of a studio"
    warn_caller(f"the lights of the file give {share}, so lighting={DEFAULT!r} is added; None leaves it out")
    return True


def _unlit(scene: Scene, settings: Settings, camera: Camera) -> Scene:
    """Return a scene in the light of the preset alone."""
    dark = copy(scene)
    dark.lights = []
    return lighted(dark, DEFAULT, up=scene.vertical(settings.values["up"]), camera=camera)


def _median(scene: Scene, settings: Settings, camera: Camera) -> float:
    """Return the median luminance of the pixels that show shapes; 0 where there are none."""
    from .session import Session  # here, as a session asks for this

    values = dict[str, Any](settings.values)
    options = {name: values[name] for name in ("max_bounces", "accel")}
    bare = copy(scene)
    bare.settings = {}
    with (
        collect_warnings(),
        Session(
            bare,
            SPP,
            camera=camera.replace(size=SIDE),
            lighting=None,
            ground=False,
            aovs=("alpha",),
            workers=1,
            executor="threads",
            branches=1,
            reuse=False,
            progress=False,
            **options,
        ) as session,
    ):
        image = session.run()
    shown = image.layers["alpha"] > 0.5
    return float(np.median(luminance(image.rgb[shown].T))) if shown.any() else 0.0
