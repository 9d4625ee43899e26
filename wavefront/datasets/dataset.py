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
from ..film.aov_names import chosen_aovs
from ..film.identity import differences
from ..io.to_scene import as_scene
from ..scene import Scene
from ..settings import RenderSettings, refuse, takes_settings
from .annotated import AnnotatedObject, annotated_objects
from .bop import BopLayout
from .coco import CocoLayout
from .view import DatasetView, camera_matrices, view_name

FORMATS = ("coco", "bop")
AOVS_NEEDED = ("depth", "normal", "shape_id")
AOVS_FOLDER, VIEWS_FOLDER = "layers", "views"
GOES_ON = "write_dataset goes on with views that are missing"
REFUSED = {"checkpoint": GOES_ON, "samples": GOES_ON, "camera": "write_dataset takes cameras"}


class Layout(Protocol):
    """The files of a format of data sets."""

    def check(self, name: str, camera: Camera) -> None:
        """Check that a camera can be described."""

    def write_view(self, view: DatasetView) -> Any:
        """Write the files of a view; return what the index needs of it, as values of JSON."""

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
        Perspective or fisheye cameras, one for each view.
    format
        "coco", "bop", or both. With "bop" cameras are perspective ones without distortion.
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
    chosen = _chosen_formats(format)
    annotated = annotated_objects(subject.shapes, objects)
    layouts: dict[str, Layout] = {}
    if "coco" in chosen:
        layouts["coco"] = CocoLayout(root, annotated)
    if "bop" in chosen:
        layouts["bop"] = BopLayout(
            root, subject.shapes, annotated, _length("millimeters", millimeters), _scale(depth_scale)
        )
    views = _checked_cameras(cameras, settings.pop("size", None), layouts)
    display = Display(gamma, exposure, tone, white_balance)
    settings["camera"] = views[0]
    if settings.get("denoise") is None:  # what learns from pictures must not learn a denoiser's ways
        settings["denoise"] = bool(subject.settings.get("denoise"))
    settings["aovs"] = (*chosen_aovs("aovs", settings.get("aovs", ())), *AOVS_NEEDED)
    about = {
        "format": sorted(chosen),
        "objects": [[item.shape, item.name] for item in annotated.values()],
        "millimeters": millimeters,
        "depth_scale": depth_scale,
        "display": repr(display),
        "layers": sorted(set(settings["aovs"])),
        "spp": spp,
        "denoise": settings["denoise"],
        "seconds": settings.get("seconds"),
    }
    writer = _Writer(root, subject, annotated, layouts, display, about)
    return writer.write(views, Session(subject, spp, **settings))


class _Writer:
    """Writes views that are missing, and the files that describe all views."""

    def __init__(
        self,
        root: Path,
        scene: Scene,
        objects: dict[int, AnnotatedObject],
        layouts: dict[str, Layout],
        display: Display,
        about: dict[str, Any],
    ) -> None:
        self._root, self._scene, self._objects = root, scene, objects
        self._layouts, self._display, self._about = layouts, display, about

    def write(self, cameras: Sequence[Camera], session: Session) -> int:
        """Write the data set; return how many views were rendered."""
        for each in (self._root, self._root / AOVS_FOLDER, self._root / VIEWS_FOLDER):
            make_folder(each)
        records, rendered = {}, 0
        with session:
            for at, camera in enumerate(cameras):
                if at:
                    session.set_camera(camera)
                identity = self._identity(session)
                record = self._earlier(at, identity)
                if record is None:
                    record = self._render(at, camera, session, identity)
                    rendered += 1
                records[at] = record
        write_json(
            self._root / "cameras.json", {view_name(at): each["camera"] for at, each in records.items()}
        )
        for name, layout in self._layouts.items():
            layout.write_index({at: each["layouts"][name] for at, each in records.items()})
        return rendered

    def _identity(self, session: Session) -> dict[str, Any] | None:
        """Return what a view must have in common with this one; None if it cannot be compared."""
        try:
            return {**session.identity(), **self._about}
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
        self, at: int, camera: Camera, session: Session, identity: dict[str, Any] | None
    ) -> dict[str, Any]:
        """Render a view and write its files, its record as the last one."""
        image = session.run()
        view = DatasetView(at, camera, image, self._objects, self._display, session.silhouettes)
        image.save(self._root / AOVS_FOLDER / f"{view.name}.exr")
        record = {
            "identity": identity,
            "camera": camera_matrices(camera, self._farthest(camera)),
            "layouts": {name: layout.write_view(view) for name, layout in self._layouts.items()},
        }
        write_json(self._root / VIEWS_FOLDER / f"{view.name}.json", record)
        return record

    def _farthest(self, camera: Camera) -> float:
        """Return a depth greater than that of all points of the scene."""
        low, high = self._scene.bounds
        return float(np.linalg.norm(camera.origin - (low + high) / 2) + np.linalg.norm(high - low))


def _chosen_formats(value: str | Sequence[str]) -> list[str]:
    names = [value] if isinstance(value, str) else list(value)
    if not names:
        raise SceneError(f"format is empty; it must be one of {', '.join(FORMATS)}, or both")
    return [one_of("format", name, FORMATS) for name in names]


def _checked_cameras(
    cameras: Iterable[Camera], size: ImageSize | None, layouts: dict[str, Layout]
) -> list[Camera]:
    """Return the cameras in the size that is asked for."""
    found = []
    for at, camera in enumerate(iterable("cameras", cameras, "cameras, such as wf.turntable(scene, 12)")):
        name = f"cameras[{at}]"
        check_camera(name, camera)
        found.append(camera if size is None else camera.resized(size))
        try:
            camera.intrinsics()
        except SceneError as error:
            raise SceneError(f"{name}: {error}") from error
        for layout in layouts.values():
            layout.check(name, camera)
    if not found:
        raise SceneError("cameras is empty; a data set needs at least one")
    return found


def _length(name: str, value: float) -> float:
    return number(name, value, lambda x: x > 0, "above 0")


def _scale(value: float | None) -> float | None:
    return None if value is None else _length("depth_scale", value)
