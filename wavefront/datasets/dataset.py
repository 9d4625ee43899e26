"""Data sets of many views of one scene."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, Protocol, Unpack

import numpy as np

from ..camera import Camera, ImageSize, check_camera
from ..codecs.display import Display
from ..codecs.png_jpeg import Gamma
from ..codecs.tone import AUTO
from ..codecs.white_balance import WhiteBalance
from ..core.errors import SceneError, iterable, number, one_of
from ..core.files import make_folder, path_name, read_json, write_json
from ..drive import Session
from ..film.aov_names import chosen_aovs, flow_names
from ..film.identity import differences
from ..io.to_scene import as_scene
from ..scene import Scene
from ..settings import RenderSettings, refuse, takes_settings
from .annotated import AnnotatedObject, annotated_objects
from .bop import BopLayout
from .coco import CocoLayout
from .flow import FLOW_LAYOUTS, check_times
from .moments import Moment, PlannedView, checked_times, moments
from .view import DatasetView, camera_matrices, view_name

FORMATS = ("coco", "bop", *FLOW_LAYOUTS)
AOVS_NEEDED = ("depth", "normal", "shape_id")
AOVS_OF_FLOW = ("flow", "flow_occluded")
AOVS_FOLDER, VIEWS_FOLDER = "layers", "views"
GOES_ON = "write_dataset goes on with views that are missing"
REFUSED = {"checkpoint": GOES_ON, "samples": GOES_ON, "camera": "write_dataset takes cameras"}


class Layout(Protocol):
    """The files of a format of data sets."""

    def check(self, name: str, camera: Camera) -> None:
        """Check that a camera can be described."""

    def write_view(self, view: DatasetView) -> Any:
        """Write the files of a view; return its entry of the index, as values of JSON."""

    def write_index(self, views: dict[int, Any]) -> None:
        """Write the files that describe all views."""


@takes_settings
def write_dataset(
    folder: str | os.PathLike[str],
    scene: Any,
    cameras: Iterable[Camera],
    spp: int | None = None,
    *,
    format: str | Sequence[str] = "coco",
    times: Iterable[float] | None = None,
    objects: Iterable[str] | None = None,
    millimeters: float = 1000.0,
    depth_scale: float | None = None,
    gamma: Gamma = 2.2,
    exposure: float = 0.0,
    tone: str = AUTO,
    white_balance: WhiteBalance | None = None,
    **settings: Unpack[RenderSettings],
) -> int:
    """Render views of a scene with annotations of its objects, as a data set for machine learning.

    Each view is written when it is done. If the call is interrupted, the same call goes on with the views
    that are missing; more cameras add views. Files are whole or not there. docs/datasets.md lists them.

    Parameters
    ----------
    folder
        Where to write; it is made if it does not exist.
    scene, spp
        As for `render`.
    cameras
        Perspective or fisheye cameras, one for each view; or with `times` one for each sequence of views.
    format
        One or several of "coco"; "bop", whose cameras are perspective ones without distortion; and, with
        optical flow from each time to the next, "kitti" and "sintel".
    times
        Seconds, rising: every camera sees the scene at each of them, and moves if it has a motion.
    objects
        Names of the shapes to annotate, for example without the floor; by default all shapes.
    millimeters
        Of a scene unit, for BOP.
    depth_scale
        Millimeters of a code of BOP's depth pictures, which have 16 bits; by default 0.1, or in a view
        deeper than 6.55 m what is needed.
    gamma, exposure, tone, white_balance
        Of the png files, as for `Image.save`.
    {settings}

    Returns
    -------
    int
        How many views were rendered; the others were there.

    Raises
    ------
    SceneError
        If an argument, a camera or the scene is malformed, or the folder has views of another scene, of other
        settings or cameras.
    SaveError
        If a file cannot be written.
    Interrupted
        After Ctrl-C. Views that were done are kept.

    Examples
    --------
    >>> scene = wf.Scene([wf.Box((0, 0, 0), 1, name="box")], wf.Environment(1))
    >>> cameras = wf.turntable(scene, 3, size=(16, 16))
    >>> wf.write_dataset("boxes", scene, cameras, spp=1, format=("coco", "bop"))
    3
    """
    refuse(settings, REFUSED)
    subject = as_scene(scene, settings.pop("material", None), settings.get("progress"))
    root = Path(path_name(folder))
    chosen, seconds = _chosen_formats(format), checked_times(times, settings.get("shutter"))
    check_times(chosen, seconds)
    annotated = annotated_objects(subject.shapes, objects)
    layouts: dict[str, Layout] = {}
    if "coco" in chosen:
        layouts["coco"] = CocoLayout(root, annotated)
    if "bop" in chosen:
        layouts["bop"] = BopLayout(
            root, subject.shapes, annotated, _length("millimeters", millimeters), _scale(depth_scale)
        )
    for name in FLOW_LAYOUTS.keys() & set(chosen):
        layouts[name] = FLOW_LAYOUTS[name](root)
    views = _checked_cameras(cameras, settings.pop("size", None), layouts)
    display = Display(gamma, exposure, tone, white_balance)
    if settings.get("denoise") is None:  # a network must not learn the errors of a denoiser
        settings["denoise"] = bool(subject.settings.get("denoise"))
    asked, needed = chosen_aovs("aovs", settings.get("aovs", ())), AOVS_NEEDED
    settings["aovs"] = (*asked, *needed, *(AOVS_OF_FLOW if FLOW_LAYOUTS.keys() & set(chosen) else ()))
    plan = moments(subject, views, seconds, bool(flow_names(settings["aovs"])))
    about = {
        "format": sorted(chosen),
        "objects": [[obj.shape, obj.name] for obj in annotated.values()],
        "millimeters": millimeters,
        "depth_scale": depth_scale,
        "display": repr(display),
        "layers": sorted(set(settings["aovs"])),
        "spp": spp,
        "denoise": settings["denoise"],
        "seconds": settings.get("seconds"),
    }
    writer = _Writer(root, subject, layouts, display, about)
    return writer.write(plan, spp, settings, objects)


class _Writer:
    """Writes views that are missing, and the files that describe all views."""

    def __init__(
        self,
        root: Path,
        scene: Scene,
        layouts: dict[str, Layout],
        display: Display,
        about: dict[str, Any],
    ) -> None:
        self._root, self._scene = root, scene
        self._layouts, self._display, self._about = layouts, display, about

    def write(
        self, plan: list[Moment], spp: int | None, settings: RenderSettings, names: Iterable[str] | None
    ) -> int:
        """Write the data set; return how many views were rendered."""
        for directory in (self._root, self._root / AOVS_FOLDER, self._root / VIEWS_FOLDER):
            make_folder(directory)
        unsorted, rendered = dict[int, dict[str, Any]](), 0
        for moment in plan:
            session_settings: Any = {**settings, **moment.about, "camera": moment.views[0].camera}
            objects = annotated_objects(moment.scene.shapes, names)
            with Session(moment.scene, spp, **session_settings) as session:
                for view in moment.views:
                    if view is not moment.views[0]:
                        session.set_camera(view.camera)
                    identity = self._identity(session, moment)
                    record = self._earlier(view.number, identity)
                    if record is None:
                        record = self._render(view, objects, session, identity)
                        rendered += 1
                    unsorted[view.number] = record
        records = dict(sorted(unsorted.items()))
        write_json(
            self._root / "cameras.json", {view_name(at): record["camera"] for at, record in records.items()}
        )
        for name, layout in self._layouts.items():
            layout.write_index({at: record["layouts"][name] for at, record in records.items()})
        return rendered

    def _identity(self, session: Session, moment: Moment) -> dict[str, Any] | None:
        """Return the identity of a view, by which it is known again; None if it cannot be compared."""
        about = {name: list(value) for name, value in moment.about.items()}
        try:
            return {**session.identity(), **self._about, **about}
        except SceneError:
            return None

    def _earlier(self, at: int, identity: dict[str, Any] | None) -> dict[str, Any] | None:
        """Return the record of a view that has been rendered; None if there is none, or none to compare."""
        path = self._root / VIEWS_FOLDER / f"{view_name(at)}.json"
        if not os.path.lexists(path):
            return None
        record = read_json(path)
        if not isinstance(record, dict) or not {"identity", "camera", "layouts"} <= record.keys():
            raise SceneError(f"{path}: is no record of a view; remove it")
        before = record["identity"]
        if not isinstance(before, dict) or identity is None:
            return None
        other = differences(before, identity)
        if other:
            raise SceneError(f"{path}: is of another data set: {', '.join(other)}; choose another folder")
        return record

    def _render(
        self,
        planned: PlannedView,
        objects: dict[int, AnnotatedObject],
        session: Session,
        identity: dict[str, Any] | None,
    ) -> dict[str, Any]:
        """Render a view and write its files, its record as the last one."""
        image, camera = session.run(), planned.camera
        place = planned.frame, planned.frames
        view = DatasetView(planned.number, camera, image, objects, self._display, session.silhouettes, *place)
        image.save(self._root / AOVS_FOLDER / f"{view.name}.exr")
        record = {
            "identity": identity,
            "camera": {
                **({} if planned.time is None else {"time": planned.time}),
                **camera_matrices(camera, self._farthest(camera)),
            },
            "layouts": {name: layout.write_view(view) for name, layout in self._layouts.items()},
        }
        write_json(self._root / VIEWS_FOLDER / f"{view.name}.json", record)
        return record

    def _farthest(self, camera: Camera) -> float:
        """Return a depth greater than that of all points of the scene."""
        low, high = self._scene.reach
        return float(np.linalg.norm(camera.origin - (low + high) / 2) + np.linalg.norm(high - low))


def _chosen_formats(value: str | Sequence[str]) -> list[str]:
    names = [value] if isinstance(value, str) else list(value)
    if not names:
        raise SceneError(f"format is empty; it must be one of {', '.join(FORMATS)}, or several")
    return [one_of("format", name, FORMATS) for name in names]


def _checked_cameras(
    cameras: Iterable[Camera], size: ImageSize | None, layouts: dict[str, Layout]
) -> list[Camera]:
    """Return the cameras in the size that is asked for."""
    checked = []
    for at, camera in enumerate(iterable("cameras", cameras, "cameras, such as wf.turntable(scene, 12)")):
        name = f"cameras[{at}]"
        check_camera(name, camera)
        checked.append(camera if size is None else camera.resized(size))
        try:
            camera.intrinsics()
        except SceneError as error:
            raise SceneError(f"{name}: {error}") from error
        for layout in layouts.values():
            layout.check(name, camera)
    if not checked:
        raise SceneError("cameras is empty; a data set needs at least one")
    return checked


def _length(name: str, value: float) -> float:
    return number(name, value, lambda x: x > 0, "above 0")


def _scale(value: float | None) -> float | None:
    return None if value is None else _length("depth_scale", value)
