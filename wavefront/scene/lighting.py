"""Ready-made light for scenes that have none of their own, and a ground that catches their shadow.

The light of a preset is an environment image: a gradient with soft boxes. The boxes are above the horizon, as
in a photo studio. The gradient alone is the backdrop that a camera sees behind the scene; mirrors and glass
show the boxes, too.
"""

from __future__ import annotations

from copy import copy
from functools import cache, lru_cache

import numpy as np
from numpy.typing import ArrayLike

from ..arrays.elementary import sin_cos_turns
from ..arrays.soa import soa
from ..arrays.vec import Doubles
from ..bsdfs import Diffuse, ShadowCatcher
from ..camera import Camera, check_camera, upward
from ..codecs.image_data import TRANSPARENT
from ..core.errors import SceneError, in_brief, one_of
from ..core.suggestions import suggests_keywords
from ..lights import Environment, Light, Sky
from ..materials import Material
from ..shapes import Mesh
from ..shapes.plate import plate
from ..textures.image import Texture
from .scene import Scene, turned_up

HEIGHT, WIDTH = 128, 256  # pixels of an environment's image
SHADOW = "shadow"  # a ground of which only the shadow is seen
GROUND_REACH = 6.0  # radius of the ground in radii of the scene
GROUND_FADE = 0.25  # width of the faded rim, relative to the ground's radius
MOST_GROUND = 0.9  # albedo of the ground at most
GROUND_GAP = 1e-4  # distance of the ground from the scene, relative to the scene's half height
OWN_LIGHT_GROUND = 0.4  # albedo of the ground where no preset is used


@soa
class SoftBox:
    """A bright rectangle with soft edges, infinitely far away."""

    azimuth: float  # degrees from the direction of the camera, to its right
    elevation: float  # degrees above the horizon
    width: float  # degrees, below 180
    height: float  # degrees, below 180
    radiance: tuple[float, float, float]  # W·sr⁻¹·m⁻² at the center
    feather: float = 0.35  # width of the soft edge, relative to the half width

    def radiance_at(self, directions: Doubles) -> Doubles:
        """Return the radiance (H, W, 3) from unit directions (3, H, W): x right, y up, z to the camera."""
        across, along = sin_cos_turns(np.float64(self.azimuth / 360))
        high, level = sin_cos_turns(np.float64(self.elevation / 360))
        right = np.array([along, 0.0, -across])
        ahead = np.array([across * level, high, along * level])
        depth = np.tensordot(ahead, directions, 1)
        in_front = depth > 1e-3
        factor = in_front.astype(float)
        for axis, size in ((right, self.width), (np.cross(ahead, right), self.height)):
            sin, cos = sin_cos_turns(np.float64(size / 720))
            offset = np.abs(np.tensordot(axis, directions, 1)) / np.where(in_front, depth, 1)
            factor *= smoothstep((1 - offset * cos / sin) / self.feather)
        return factor[:, :, None] * np.array(self.radiance)


@soa
class Preset:
    """A gradient from bottom to top, and soft boxes, which are above the horizon."""

    gradient: tuple[tuple[float, float], ...]  # sine of the elevation, rising; radiance, W·sr⁻¹·m⁻²
    boxes: tuple[SoftBox, ...] = ()

    def pixels(self) -> Doubles:
        """Return the image (H, W, 3) of the environment, as `Environment` lays it out."""
        image = self.backdrop()
        for box in self.boxes:
            image[: HEIGHT // 2] += box.radiance_at(_directions()[:, : HEIGHT // 2])
        return image

    def backdrop(self) -> Doubles:
        """Return the image without the soft boxes, which a camera does not see."""
        directions = _directions()
        heights, levels = np.array(self.gradient).T
        place = np.clip(np.searchsorted(heights, directions[1]) - 1, 0, len(heights) - 2)
        step = (directions[1] - heights[place]) / np.diff(heights)[place]
        shade = levels[place] + np.diff(levels)[place] * smoothstep(step)
        return np.repeat(shade[:, :, None], 3, 2)

    @cache  # noqa: B019 - presets live as long as the module
    def ground_albedo(self) -> tuple[float, float, float]:
        """Return the albedo of a level ground that is as bright as the gradient below the horizon."""
        pixels, (_, up, _) = self.pixels(), _directions()
        irradiance = (pixels * (np.maximum(up, 0) * _solid_angles())[:, :, None]).sum((0, 1))
        red, green, blue = np.minimum(np.pi * self.gradient[0][1] / irradiance, MOST_GROUND).tolist()
        return red, green, blue


def smoothstep(x: Doubles) -> Doubles:
    """Return 0 below 0, 1 above 1, and 3x² − 2x³ between them."""
    x = np.clip(x, 0, 1)
    return x * x * (3 - 2 * x)


@cache
def _directions() -> Doubles:
    """Return the unit directions (3, H, W) of the pixels' centers."""
    level, high = sin_cos_turns((np.arange(HEIGHT) + 0.5)[:, None] / (2 * HEIGHT))
    across, along = sin_cos_turns(0.5 - (np.arange(WIDTH) + 0.5) / WIDTH)
    return np.stack([level * across, high * np.ones(WIDTH), level * along])


def _solid_angles() -> Doubles:
    """Return the solid angle of each pixel, (H, W) sr."""
    _, edges = sin_cos_turns(np.arange(HEIGHT + 1) / (2 * HEIGHT))
    return np.repeat((edges[:-1] - edges[1:])[:, None] * (2 * np.pi / WIDTH), WIDTH, 1)


def _tinted(radiance: float, warmth: float) -> tuple[float, float, float]:
    return radiance * (1 + warmth), radiance, radiance * (1 - warmth)


# A surface that faces the brightest side gets 0.9 to 1.1 times the irradiance of a constant environment of
# radiance 1, so white surfaces are not clipped. A camera at the height of `Scene.framing_camera` sees no box,
# from any side.
PRESETS = {
    "studio": Preset(
        # between the shades of albedos 0.03 and 0.2, so that dark and bright things stand out; brighter
        # behind the upper edges of things, which get more light
        ((-1, 0.0535), (-0.35, 0.0535), (0.0, 0.068), (0.95, 0.0875)),
        (
            SoftBox(-46, 36, 56, 48, _tinted(4.5, 0.02)),  # key
            SoftBox(45, 27, 52, 42, _tinted(0.75, -0.03)),  # fill
            SoftBox(-150, 40, 50, 50, _tinted(0.9, 0.0)),  # rim
            SoftBox(-112, 33, 46, 44, _tinted(1.4, 0.0)),  # side
            SoftBox(112, 35, 46, 44, _tinted(2.0, 0.0)),  # other side
        ),
    ),
    "softbox": Preset(
        ((-1, 0.09), (-0.4, 0.09), (0.12, 0.035), (1, 0.05)),
        (SoftBox(-30, 52, 80, 70, _tinted(2.7, 0.01), feather=0.25),),
    ),
    "three_point": Preset(
        ((-1, 0.1), (-0.4, 0.1), (0.12, 0.04), (1, 0.06)),
        (
            SoftBox(-45, 38, 26, 26, _tinted(17.0, 0.03)),  # key
            SoftBox(55, 25, 34, 34, _tinted(3.2, -0.03)),  # fill
            SoftBox(155, 42, 24, 24, _tinted(12.0, 0.0)),  # back
        ),
    ),
    "cloudy": Preset(((-1, 0.1), (-0.35, 0.1), (0.12, 0.45), (1, 1.3))),
}
# A clear sky and the sun: direction from right, up and front; W·m⁻² from the sky, and from the sun that faces
SUN, SKYLIGHT, SUNLIGHT = (-0.65, 0.62, 0.45), (0.45, 0.65, 1.0), (2.75, 2.45, 2.0)
DAYLIGHT_GROUND = 0.3  # albedo
LIGHTINGS = (*PRESETS, "daylight", "even")
DEFAULT = "studio"
FRONT = 0.35, 0.3, 1.0  # direction of the camera that light is relative to by default, where y is up
STEEP = 1e-3  # sine between the view and the vertical below which a camera looks straight down


@suggests_keywords
def studio(preset: str = DEFAULT, *, up: ArrayLike = "y", camera: Camera | None = None) -> list[Light]:
    """Return the lights of a preset, to be put into a `Scene`.

    Parameters
    ----------
    preset
        "studio": a large key light from the left, a fill from the right, and light on the edges from both
        sides and from behind, before a gray gradient. "softbox": one large light before a darker one.
        "three_point": key, fill and back light, smaller, with harder shadows. "cloudy": an overcast sky,
        brightest overhead. "daylight": a clear blue sky and the sun, from the left and behind the camera.
        "even": the same from all around.
    up
        Up direction of the scene: (3,), or the name of an axis, such as "z".
    camera
        Left, right, front and behind are relative to this camera. By default they are relative to one in
        front of the scene, 19° to the right, also if another camera renders the scene: the light stays in
        place while a camera moves around the scene. The `lighting` of a scene that `render` frames is
        relative to the camera of the picture.

    Returns
    -------
    list
        One `Environment`, or one `Sky`. Its light comes from infinity, so it suits scenes of any size.

    Raises
    ------
    SceneError
        If there is no such preset, or `up` is malformed or zero.

    Examples
    --------
    >>> scene = wf.Scene(wf.Sphere((0, 0, 0), 1), lights=wf.studio("softbox"))
    >>> wf.render(scene, spp=1, size=(16, 16)).shape
    (16, 16, 3)
    """
    one_of("preset", preset, LIGHTINGS)
    axes = _axes(up, check_camera("camera", camera))
    if preset == "even":
        return [Environment(1.0)]
    if preset == "daylight":
        sun = axes @ SUN
        return [
            Sky.cie(12, sun, axes[:, 1], horizontal=SKYLIGHT, direct_normal=SUNLIGHT, ground=DAYLIGHT_GROUND)
        ]
    light = copy(_environment(preset, tuple(map(tuple, axes.tolist()))))
    light.backdrop = copy(light.backdrop)
    return [light]


@lru_cache(maxsize=2)  # one takes 2.7 MB with its tables
def _environment(preset: str, axes: tuple[tuple[float, ...], ...]) -> Environment:
    pixels, backdrop = PRESETS[preset].pixels(), PRESETS[preset].backdrop()
    light = Environment(pixels.astype(np.float32), transform=axes, backdrop=backdrop.astype(np.float32))
    light.sample_in_texels()
    return light


def check_lighting(lighting: str | None) -> None:
    """Check the setting `lighting` of `render`.

    Raises
    ------
    SceneError
        If it is not the name of a preset, "auto" or None.
    """
    if lighting is not None and not (isinstance(lighting, str) and lighting in ("auto", *LIGHTINGS)):
        known = ", ".join(LIGHTINGS)
        raise SceneError(f"lighting is {in_brief(lighting)}; it must be auto, None or one of {known}")


def choose_preset(scene: Scene, lighting: str | None) -> str | None:
    """Return the preset that lights a scene; None for none.

    "auto" means the default preset for a scene without lights, and none for other scenes.

    Raises
    ------
    SceneError
        If a preset is requested and the scene has an `Environment` or a `Sky`.
    """
    if lighting == "auto":
        return None if scene.emits else DEFAULT
    if lighting is not None and any(isinstance(light, Environment | Sky) for light in scene.lights):
        raise SceneError(
            f"lighting={lighting!r} brings an Environment, and the scene has one or a Sky; "
            "at most one is allowed"
        )
    return lighting


def choose_ground(ground: bool | str, chosen_light: bool, above: bool, background: object) -> bool | str:
    """Return whether a ground is added; `SHADOW` for one of which only the shadow on it is seen.

    Parameters
    ----------
    ground
        As for `render`: "auto" adds one where the light is chosen, too.
    chosen_light
        Whether the light was chosen because the scene has none.
    above
        Whether the camera is above the ground: from below, it would hide the scene.
    background
        As for `render`; a ground would cover it. On a transparent one the shadow is seen.
    """
    if not isinstance(ground, str) or ground == SHADOW:
        seen_through = isinstance(background, str) and background == TRANSPARENT
        return SHADOW if ground and seen_through else ground
    return chosen_light and above and background is None


def is_above(scene: Scene, camera: Camera, framed: bool, up: ArrayLike) -> bool:
    """Return whether a camera sees the ground of a scene from above.

    One that frames the scene must not look up; one of the scene's own must be higher than the ground, and not
    measure light.
    """
    vertical = turned_up(upward("up", up))[:, 1]
    if framed:
        return bool(camera.rotation[:, 2] @ vertical > -STEEP)
    return camera.sensor is None and bool(
        camera.origin @ vertical > _ground_center(scene, vertical) @ vertical
    )


def lighted(
    scene: Scene,
    preset: str | None,
    *,
    ground: bool | str = False,
    up: ArrayLike = "y",
    camera: Camera | None = None,
) -> Scene:
    """Return a copy of the scene with the light of a preset and a ground; the scene itself without both.

    The light is relative to the camera, as in `studio`. Of a ground that is `SHADOW` only the shadow is seen.
    """
    if preset is None and not ground:
        return scene
    complete = copy(scene)  # keeps the accelerators of the last render
    if preset is not None:
        complete.lights = [*scene.lights, *studio(preset, up=up, camera=camera)]
    if ground:
        kind = ShadowCatcher if ground == SHADOW else Diffuse
        complete.shapes = [*scene.shapes, _ground(scene, preset, up, kind)]
    return complete


def _ground(scene: Scene, preset: str | None, up: ArrayLike, kind: type[Diffuse]) -> Mesh:
    """Return a level surface of some kind under a scene, that fades out towards the rim of a disk.

    Outside of shadows it is as bright as the lower half of the preset's environment, so neither an edge nor a
    horizon is visible.
    """
    low, high = scene.reach
    radius = float(np.linalg.norm(high - low)) / 2
    vertical = turned_up(upward("up", up))[:, 1]
    if preset is None:
        albedo = (OWN_LIGHT_GROUND,) * 3
    else:
        even = {"daylight": DAYLIGHT_GROUND, "even": MOST_GROUND}
        albedo = PRESETS[preset].ground_albedo() if preset in PRESETS else (even[preset],) * 3
    texels = np.linspace(-1, 1, 129)
    rim = np.sqrt(texels[:, None] * texels[:, None] + texels * texels)
    alpha = smoothstep((1 - rim) / (1 - GROUND_FADE))
    return plate(
        _ground_center(scene, vertical),
        vertical,
        GROUND_REACH * radius,
        material=Material(kind(albedo), alpha=Texture(alpha, channel=0, wrap="clamp")),
        name="ground",
    )


def _ground_center(scene: Scene, vertical: Doubles) -> Doubles:
    """Return the point (3,) just below the lowest corner of a scene's box, below its center."""
    low, high = scene.reach
    depth = float(np.abs(vertical) @ (high - low)) / 2
    return (low + high) / 2 - vertical * depth * (1 + GROUND_GAP)


def _axes(up: ArrayLike, camera: Camera | None) -> Doubles:
    """Return the axes right, up and front of a studio, columns of (3, 3)."""
    turn = turned_up(upward("up", up))
    vertical = turn[:, 1]
    front = turn @ FRONT if camera is None else camera.rotation[:, 2]
    if np.linalg.norm(np.cross(vertical, front)) < STEEP and camera is not None:
        # towards the lower edge of its picture if it looks down
        front = -camera.rotation[:, 1] * np.sign(vertical @ front)
    right = np.cross(vertical, front)
    right /= np.linalg.norm(right)
    return np.stack([right, vertical, np.cross(right, vertical)], 1)
