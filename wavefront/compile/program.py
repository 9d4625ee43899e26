"""The program of a compiled scene: its features, each bound to the points between stages where it acts.

A feature is a rare property of scenes, such as a background or absorption. It is one file in features/: a
class that says when a scene has it, and overrides the points where it acts. Each kind of feature is asked
once, when a scene is compiled. Stages then go through tuples of the features that act at a point: a scene
without features pays for none, and no stage asks for absent ones.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import field, replace
from typing import TYPE_CHECKING, Any, ClassVar, Self, TypeVar

from ..arrays.soa import soa
from ..arrays.state import Contribution, Hits, Paths, Rays, SurfaceInteraction, Words
from ..arrays.vec import Bools, Floats, Ints, Lanes, length
from ..camera import Camera
from ..core.errors import SceneError, in_brief
from ..materials import Material
from ..sampling.sampler import Dimension, Sampler, numbers_of
from ..scene import Scene

if TYPE_CHECKING:
    from .scene import CompiledScene


@soa
class Facts:
    """The facts of a scene by which features decide whether it has them."""

    scene: Scene
    compiled: CompiledScene  # its arrays; its program is empty so far
    materials: Sequence[Material]  # all of the scene, by their numbers
    nonscattering_lights: Bools | None  # (lights,) those whose surface is black; None when there are none
    corners: Floats  # (m, 3, 3) of the triangles, as they are in the arrays
    has_alpha: Bools  # (m + k + 1,) primitives whose opacity is below 1
    asked: Mapping[str, Any]  # settings, by their names
    user_features: Sequence[Feature]
    features: list[Feature]  # those that the scene has, so far in the order


@soa
class Leg:
    """Paths on their way from one surface, or the camera, to the next. Features may replace its arrays."""

    scene: CompiledScene
    sampler: Sampler
    bounce: int
    L: Floats  # (3, slots) where light is added
    mis: bool  # light that paths meet is weighted against light samples
    left: Ints  # (n,) primitives that the paths have left, -1 for none
    paths: Paths
    hits: Hits
    emission: Contribution = field(init=False)  # of the surfaces and lights that the paths meet
    lanes: Ints = field(init=False)  # (k,) of the paths that go on
    kept_paths: Paths = field(init=False)  # those, as they will be shaded
    kept_hits: Hits = field(init=False)

    @property
    def length(self) -> Floats:
        """How far the hits are from where the paths started or last scattered, (n,); inf on a miss."""
        behind = length(self.paths.origin - self.paths.last_vertex)  # 0 where they have passed nothing
        return self.hits.t + behind


@soa
class Passage:
    """Rays at surfaces that they, or a part of their light, may pass straight on."""

    scene: CompiledScene
    rays: Any  # n `Rays`, such as `Paths` and `ShadowRays`
    surface: SurfaceInteraction
    sampler: Sampler | None  # of paths; None where nothing is random
    segment: int  # how many surfaces they have passed before

    def take(self, lanes: Ints) -> Passage:
        """Return some lanes (k,)."""
        return replace(self, rays=self.rays.take(lanes), surface=self.surface.take(lanes))


class Feature:
    """A rare property of scenes. A subclass overrides `of` and the points where it acts.

    A feature is sent to workers with the scene, so its attributes are arrays and the like. Those of your own
    are given as `features=` of a render. They act after all others. Paths from lights do not meet them.

    Attributes
    ----------
    camera_only
        It acts on the first leg of paths from the camera alone, and not on those from sensors.
    from_lights
        Paths from lights meet it, too.
    drawn
        Its opacities draw random numbers, so that only paths meet them.
    dims_shadows
        Its surfaces let a part of the light of shadow rays through.
    shading
        A subclass of `stages.shade.Shading` whose methods act where surfaces are shaded; None for none.
    surfaces
        A subclass of `stages.interaction.Surfaces` that changes the data of hits; None for none.
    ways
        In how many ways each path goes on from its first surface.
    dimensions
        Numbers that `sampler.draw_1d` and `draw_2d` take for features of your own. Two of one render must not
        draw by the same one.
    spares_opaque
        No ray may pass primitives that have no alpha (`Facts.has_alpha`).
    compared
        Two renders must have it in common so that one can go on from the checkpoint of the other. False where
        it follows from settings, which are compared by themselves.

    Examples
    --------
    >>> class Dusk(wf.Feature):
    ...     '''Halves all light that the camera sees directly.'''
    ...     camera_only = True
    ...     def meet(self, leg):
    ...         leg.emission.radiance = leg.emission.radiance / 2
    >>> wf.render([wf.Sphere((0, 0, 0), 1), wf.Environment(1.0)], spp=1, size=(8, 8), features=Dusk())[0, 0]
    array([0.5, 0.5, 0.5], dtype=float32)
    """

    __slots__ = ()
    camera_only: ClassVar[bool] = False
    from_lights: ClassVar[bool] = True
    drawn: ClassVar[bool] = False
    dims_shadows: ClassVar[bool] = False
    spares_opaque: ClassVar[bool] = False
    compared: ClassVar[bool] = True
    shading: ClassVar[Any] = None
    surfaces: ClassVar[Any] = None
    ways: int = 1
    dimensions: ClassVar[range] = numbers_of(Dimension.FEATURE)

    @classmethod
    def of(cls, facts: Facts) -> Self | None:
        """Return the feature of a scene; None if the scene does not have it."""
        return None

    # --- Of paths from the camera ---------------------------------------------------------------------

    def begin(self, scene: CompiledScene, paths: Paths) -> None:
        """Give paths that start at the camera the columns that they need."""

    def expose(
        self, scene: CompiledScene, camera: Camera, rays: Rays, pixel: Words, draw: Callable[[Words], Floats]
    ) -> None:
        """Give rays of a camera, through pixels (n,) of the whole picture, times.

        `draw` returns numbers in [0, 1) for addresses (n,), such as the pixels.
        """

    def fly(self, leg: Leg) -> None:
        """Change paths and their hits, before any light is added."""

    def meet(self, leg: Leg) -> None:
        """Change the light that paths meet, before it is added, and which paths go on."""

    # --- Of straight rays of all kinds: of paths, to lights, from lights ------------------------------

    def passable(self, scene: CompiledScene, rays: Rays, hits: Hits, lanes: Lanes) -> Bools:
        """Return which of some lanes (k,) hit surfaces that rays, or a part of them, pass straight on."""
        raise NotImplementedError

    def thin(self, opacity: Floats, passage: Passage) -> None:
        """Lower, in place, the opacities (n,) of surfaces."""
        raise NotImplementedError

    def cross(self, passage: Passage) -> None:
        """Change the columns of rays that have passed their surfaces."""

    def walk(self, leg: Leg, lanes: Ints, segment: int) -> Ints:
        """Take some lanes (k,) of a leg to the next surfaces; return those that get there.

        `segment` counts the surfaces that they have passed.
        """
        raise NotImplementedError

    def dim(self, part: Floats, scene: CompiledScene, rays: Any, length: Floats, end: Bools) -> None:
        """Lower, in place, the part (3, n) of light that passes along shadow rays of some lengths (n,).

        `end` (n,) says which rays end there.
        """

    def tilt(self, scene: CompiledScene, rays: Rays, surface: SurfaceInteraction) -> None:
        """Change, in place, surfaces that rays have hit, before they are shaded."""

    def weaken(self, throughput: Floats, hits: Hits, surface: SurfaceInteraction) -> None:
        """Weaken, in place, the throughput (3, n) of rays that have come to surfaces."""


LEG_POINTS = ("fly", "meet")
AnyFeature = TypeVar("AnyFeature", bound=Feature)


def check_features(name: str, value: Any) -> tuple[Feature, ...]:
    """Check features of a user's own, and return them as a tuple.

    Raises
    ------
    SceneError
        If something else is among them.
    """
    features = tuple(value) if isinstance(value, list | tuple) else (value,)
    for feature in features:
        if not isinstance(feature, Feature):
            raise SceneError(
                f"{name} is {in_brief(value)}; it must be one or more objects of subclasses of wf.Feature"
            )
    return features


class LegProgram:
    """The features of a leg: for each point, a tuple of methods that act there; empty for most scenes."""

    __slots__ = (*LEG_POINTS, "see_through")

    def __init__(self, features: Sequence[Feature]) -> None:
        self.see_through = tuple(feature for feature in features if acts(feature, "passable"))
        self.fly, self.meet = (_at(features, point) for point in LEG_POINTS)


class Program:
    """The features of a scene, by the points where they act.

    Parameters
    ----------
    features
        Those that the scene has, in the order in which they act.

    Attributes
    ----------
    expose, begin, walk, cross, dim, tilt, weaken
        Methods that act at these points.
    shading, surfaces
        Classes of surfaces when they are shaded, and when they are hit, the outermost kind first.
    see_through
        Features of surfaces that shadow rays may pass.
    seen_through
        Features of surfaces that rays of the camera may pass where nothing is random.
    unseen
        Features whose surfaces the camera does not see.
    dims_shadows
        Whether shadow rays may arrive with a part of their light.
    branches
        How many paths a path from the camera becomes at its first surface.
    """

    def __init__(self, features: Sequence[Feature] = ()) -> None:
        self.features = tuple(features)
        everywhere = [feature for feature in features if not feature.camera_only]
        self._camera, self._later = LegProgram(self.features), LegProgram(everywhere)
        self.expose, self.begin, self.walk, self.cross, self.dim, self.tilt, self.weaken = (
            _at(self.features, point)
            for point in ("expose", "begin", "walk", "cross", "dim", "tilt", "weaken")
        )
        self.shading, self.surfaces = (
            tuple(
                getattr(feature, name)
                for feature in reversed(self.features)
                if getattr(feature, name) is not None
            )
            for name in ("shading", "surfaces")
        )
        self.branches = math.prod(feature.ways for feature in self.features)
        self.see_through = self._later.see_through
        self.seen_through = tuple(feature for feature in self._camera.see_through if not feature.drawn)
        self.unseen = tuple(feature for feature in self._camera.see_through if feature.camera_only)
        self.dims_shadows = bool(self.dim) or any(feature.dims_shadows for feature in self.see_through)

    @classmethod
    def of(cls, facts: Facts, kinds: Sequence[type[Feature]]) -> Self:
        """Return the program of a scene, which may have features of some kinds."""
        for kind in kinds:
            feature = kind.of(facts)
            if feature is not None:
                facts.features.append(feature)
        return cls([*facts.features, *facts.user_features])

    def leg(self, bounce: int) -> LegProgram:
        """Return the program of the leg that ends at a bounce."""
        return self._later if bounce else self._camera

    def ways(self, bounce: int) -> int:
        """Return in how many ways each path goes on from the surfaces of a bounce."""
        return 1 if bounce else self.branches

    def plus(self, *features: Feature) -> Program:
        """Return the program with more features, which act last."""
        return Program([*self.features, *features]) if features else self

    def of_sensors(self) -> Program:
        """Return the program of paths that start at sensors: these measure the light that is there."""
        return Program([feature for feature in self.features if not feature.camera_only])

    def of_lights(self) -> Program:
        """Return the program of paths from lights."""
        return Program([feature for feature in self.features if feature.from_lights])

    def find(self, kind: type[AnyFeature]) -> AnyFeature | None:
        """Return the feature of a kind; None if the scene does not have it."""
        return next((feature for feature in self.features if isinstance(feature, kind)), None)

    def __reduce__(self) -> tuple[Any, ...]:
        """Send only the features to other processes."""
        return type(self), (self.features,)


def acts(feature: Feature, point: str) -> bool:
    """Return whether a feature acts at a point."""
    return getattr(type(feature), point) is not getattr(Feature, point)


def _at(features: Sequence[Feature], point: str) -> tuple[Any, ...]:
    return tuple(getattr(feature, point) for feature in features if acts(feature, point))
