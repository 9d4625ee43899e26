"""The camera: its pose, its projection, and the part of the picture that is rendered."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from copy import copy
from typing import Any, Literal, Self, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays.elementary import arctan2
from ..arrays.state import Words
from ..arrays.vec import Doubles, Floats, column, f4, normalize
from ..core.errors import (
    SceneError,
    as_array,
    finite_array,
    in_brief,
    number,
    one_of,
    rotation_matrix,
    warn_caller,
)
from ..core.parameter import brief
from ..core.suggestions import Answers, suggests_keywords
from ..motion import Inverse, Motion, Moving, Product, product
from ..sampling.tiles import PictureTiles, Tiles
from .distortion import Distortion
from .fisheye import Fisheye
from .poses import upright
from .projection import Orthographic, Panorama, Perspective, Projection

MAX_SIDE = 65_536  # pixels; a row-major pixel index then fits in 32 bits
STEP = 1e-4  # of a point's distance: how far it is moved to find out how the film point moves
RADIANS = (0.2, 3.2)  # a field of view in this range is probably in radians
CENTERS = {"integer": 0.5, "half": 0.0}  # film position less pixel coordinate, for each way of counting
PixelCenters = Literal["integer", "half"]
ImageSize: TypeAlias = tuple[int, int] | int  # pixels: (width, height), or one number for a square
Window = tuple[int, int, int, int]


_FRAMED: list[Callable[..., Any]] = []


def register_framing(choose: Callable[..., Any]) -> None:
    """Let `Camera.framing` call the function that chooses a camera: (scene, view, fov, size, up)."""
    _FRAMED[:] = [choose]


class Camera(Moving, Answers):
    """A camera. Use `Camera.look_at` or one of the other class methods.

    Attributes
    ----------
    origin
        (3,) position, scene units.
    rotation
        (3, 3) columns: right, up and backward in world space.
    projection
        The map from points of the film to rays.
    resolution
        (width, height) in pixels of the whole picture.
    window
        (x0, y0, x1, y1) in pixels of the whole picture: the part that is rendered. Column x1 and row y1 are
        not part of it.
    rolling_shutter
        Seconds in which the sensor is read, row by row from the top; negative from the bottom, 0 at once.
    motion, moves, time_span
        Where it goes, a `Motion` from camera space ("opengl") to the world (None: nowhere); whether it moves,
        and from when to when, seconds. Its origin and rotation are those of its start; `at` gives other
        times.

    Examples
    --------
    >>> camera = wf.Camera.look_at((0, 0, 4), (0, 0, 0), fov=40, size=(64, 48))
    >>> pixels, depth = camera.project([(0, 0, 0)])
    >>> pixels[0], depth[0]
    (array([32., 24.]), np.float64(4.0))
    """

    sensor: str | None = None  # the quantity that pixels measure; None where they form a picture
    scatterings: int = 0  # of each path before it leaves the camera
    rolling_shutter: float = 0.0
    course: Motion | None = None  # of which `at` has made a moment

    @suggests_keywords
    def __init__(
        self,
        origin: ArrayLike,
        rotation: ArrayLike,
        projection: Projection,
        size: ImageSize,
        crop: Window | None = None,
        *,
        rolling_shutter: float = 0.0,
    ) -> None:
        self.origin = finite_array("Camera origin", origin, (3,))
        self.rotation = rotation_matrix("Camera rotation", rotation)
        if not isinstance(projection, Projection):
            raise SceneError(f"Camera projection is {in_brief(projection)}; it must be a wf.Projection")
        self.projection = projection
        self.resolution = image_size(size)
        projection.check(self.resolution)
        self.window = _window(crop, self.resolution)
        read = number("Camera rolling_shutter", rolling_shutter)
        if read:  # others have the same fingerprint as without this parameter
            self.rolling_shutter = read

    def __repr__(self) -> str:
        """Name the projection, where the camera stands and where it looks, and the size."""
        ahead = brief(-self.rotation[:, 2] + 0.0)
        size = f"{self.size[0]} × {self.size[1]}"
        crop = "" if self.size == self.resolution else f" of {self.resolution[0]} × {self.resolution[1]}"
        return f"<Camera: {self.projection!r} at {brief(self.origin)} towards {ahead}, {size}{crop}>"

    # --- Constructors ---------------------------------------------------------------------------

    @classmethod
    @suggests_keywords
    def look_at(
        cls,
        origin: ArrayLike,
        target: ArrayLike,
        up: ArrayLike = (0, 1, 0),
        fov: float = 40,
        *,
        size: ImageSize = (512, 512),
        aperture: float = 0,
        focus: float | None = None,
        shift: tuple[float, float] = (0, 0),
        crop: Window | None = None,
    ) -> Camera:
        """Place a camera at `origin` that looks at `target`.

        Parameters
        ----------
        origin, target
            (3,) position, and the point in the middle of the picture.
        up
            The up direction of the picture: (3,), or the name of an axis, such as "z".
        fov
            Vertical field of view, degrees.
        size
            (width, height) in pixels.
        aperture
            Diameter of the lens, scene units. With 0 (a pinhole) everything is sharp.
        focus
            Distance of the plane in focus along the view axis, scene units; by default that of the target.
        shift
            Lens shift: moves the film (right, up) in its plane, as fractions of the picture's width and
            height. The view moves without a change of perspective.
        crop
            (x0, y0, x1, y1) in pixels from the left and the top: only this window is rendered. Its pixels are
            the same as in the whole picture, except for their noise where `reuse` or `caustics` is on.

        Raises
        ------
        SceneError
            If origin and target coincide, up is parallel to the view, or an argument is out of range.
        """
        eye, axes, distance = _look(origin, target, up)
        focus = distance if focus is None else focus
        return cls(
            eye,
            axes,
            Perspective(field_of_view(fov), shift=shift, aperture=aperture, focus=focus),
            size,
            crop,
        )

    @classmethod
    @suggests_keywords
    def from_matrix(
        cls,
        cam_to_world: ArrayLike | Motion,
        fov: float = 40,
        *,
        size: ImageSize = (512, 512),
        convention: Literal["opengl", "opencv"] = "opengl",
        aperture: float = 0,
        focus: float | None = None,
        shift: tuple[float, float] = (0, 0),
        crop: Window | None = None,
    ) -> Camera:
        """Place a camera by its matrix to world space.

        Parameters
        ----------
        cam_to_world
            (4, 4) or (3, 4): rotation and position. Or a motion, such as `Keyframes`: the camera moves.
        fov, size, aperture, focus, shift, crop
            As for `look_at`; with an aperture, `focus` must be given.
        convention
            The axes of camera space. "opengl", as in glTF and Blender: x right, y up,
            looking along -z. "opencv": x right, y down, looking along +z.

        Raises
        ------
        SceneError
            If the matrix scales, shears or mirrors, or an argument is out of range.
        """
        signs = _axes_of(convention)
        if isinstance(cam_to_world, Motion):
            _rigid("cam_to_world", cam_to_world.at(cam_to_world.start))
            axes, eye = np.eye(3), np.zeros(3)
        else:
            axes, eye = _rigid("cam_to_world", cam_to_world)
        lens = Perspective(field_of_view(fov), shift=shift, aperture=aperture, focus=focus)
        camera = cls(eye, axes * signs, lens, size, crop)
        return camera.transformed(cam_to_world) if isinstance(cam_to_world, Motion) else camera

    @classmethod
    @suggests_keywords
    def from_intrinsics(
        cls,
        K: ArrayLike,
        R: ArrayLike | Motion,
        t: ArrayLike | None = None,
        size: ImageSize | None = None,
        *,
        distortion: ArrayLike | None = None,
        pixel_centers: PixelCenters = "integer",
        aperture: float = 0,
        focus: float | None = None,
        crop: Window | None = None,
    ) -> Camera:
        """Place a calibrated camera in OpenCV's convention: x right, y down, z forward.

        A world point X is projected to the pixel coordinates K·(R·X + t), divided by their third component.

        Parameters
        ----------
        K
            (3, 3) intrinsics [[fx, s, cx], [0, fy, cy], [0, 0, 1]] in pixels.
        R, t
            Rotation (3, 3) and translation, (3,) or (3, 1), from world to camera space; or `R` alone as one
            matrix (4, 4) or (3, 4) of both, the extrinsics; or a motion of such matrices, as `Keyframes`.
        size
            (width, height) in pixels; it must be given.
        distortion
            Distortion coefficients of the lens as in OpenCV: (k1, k2, p1, p2), also with k3, or with k3, k4,
            k5, k6 (Brown and Conrady).
        pixel_centers
            Where the centers of pixels are in K. "integer", as OpenCV, ROS and BOP: the upper left center is
            (0, 0), and a principal point in the middle is ((width - 1)/2, (height - 1)/2). "half", as COLMAP
            and instant-ngp: the upper left center is (0.5, 0.5), and the middle (width/2, height/2).
        aperture, focus, crop
            As for `from_matrix`.

        Raises
        ------
        SceneError
            If K has another form, R is not a rotation, an argument is out of range, or the distortion is not
            invertible inside the picture.
        """
        if size is None:
            raise SceneError("from_intrinsics needs size=(width, height), that of the calibrated pictures")
        height = image_size(size)[1]
        fy, parts = _calibration(K, image_size(size), pixel_centers)
        axes, shift = _extrinsics(R.at(R.start) if isinstance(R, Motion) else R, t)
        lens = Perspective(
            2 * float(np.degrees(arctan2(np.float64(height / 2), np.float64(fy)))),
            aperture=aperture,
            focus=focus,
            distortion=None if distortion is None else Distortion(distortion),
            **parts,
        )
        camera = cls(-axes.T @ shift, axes.T * (1, -1, -1), lens, size, crop)
        if isinstance(R, Motion):
            camera.motion = Product(Inverse(R), np.diag([1.0, -1, -1, 1]))
        return camera

    @classmethod
    @suggests_keywords
    def fisheye(
        cls,
        K: ArrayLike,
        D: ArrayLike | None = None,
        R: ArrayLike | None = None,
        t: ArrayLike | None = None,
        size: ImageSize | None = None,
        *,
        mapping: str = "equidistant",
        pixel_centers: PixelCenters = "integer",
        aperture: float = 0,
        focus: float | None = None,
        crop: Window | None = None,
    ) -> Camera:
        """Place a calibrated camera with a fisheye lens in OpenCV's convention, that of `cv2.fisheye`.

        A point at angle θ to the axis is seen at K·(θ_d·x/ρ, θ_d·y/ρ, 1), where (x, y) is its place across
        the axis, ρ the length of that, and θ_d = θ·(1 + k1·θ² + k2·θ⁴ + k3·θ⁶ + k4·θ⁸).

        Parameters
        ----------
        K
            As for `from_intrinsics`; the skew K[0][1] is fx·alpha of OpenCV.
        D
            (k1, k2, k3, k4), of any shape; by default zeros.
        R, t
            As for `from_intrinsics`; by default the camera is at the origin and looks along z, with y down.
        size
            (width, height) in pixels; it must be given.
        mapping
            "equidistant", or another one of `Fisheye`, without D.
        pixel_centers
            As for `from_intrinsics`.
        aperture, focus, crop
            As for `from_matrix`.

        Raises
        ------
        SceneError
            If K has another form, R is not a rotation, or an argument is out of range.

        Notes
        -----
        Directions more than 90° from the axis are seen, too, up to the angle where the polynomial folds.
        Beyond it the picture is black. Source: J. Kannala and S. Brandt, "A Generic Camera Model and
        Calibration Method for Conventional, Wide-Angle, and Fish-Eye Lenses", IEEE PAMI 28(8), 2006.

        Examples
        --------
        >>> K = [[160, 0, 255.5], [0, 160, 255.5], [0, 0, 1]]
        >>> camera = wf.Camera.fisheye(K, (-0.02, 0.003, 0, 0), size=512)
        >>> camera.project([(1, 0, 1), (1, 0, -0.1)], "integer")[0].round(2)
        array([[379.76, 255.5 ],
               [514.1 , 255.5 ]])
        """
        if size is None:
            raise SceneError("fisheye needs size=(width, height), that of the calibrated pictures")
        fy, parts = _calibration(K, image_size(size), pixel_centers)
        alone = R is None and t is None
        axes, shift = (np.eye(3), np.zeros(3)) if alone else _extrinsics(np.eye(3) if R is None else R, t)
        lens = Fisheye(
            focal=fy / image_size(size)[1],
            mapping=mapping,
            distortion=None if D is None else finite_array("D", np.ravel(as_array("D", D)), (4,)),
            aperture=aperture,
            focus=focus,
            **parts,
        )
        return cls(-axes.T @ shift, axes.T * (1, -1, -1), lens, size, crop)

    @classmethod
    @suggests_keywords
    def orthographic(
        cls,
        origin: ArrayLike,
        target: ArrayLike,
        up: ArrayLike = (0, 1, 0),
        *,
        height: float,
        size: ImageSize = (512, 512),
        crop: Window | None = None,
    ) -> Camera:
        """Place a camera with parallel rays, which start on the film at `origin`.

        Parameters
        ----------
        origin, target, up, size, crop
            As for `look_at`.
        height
            Of the picture, scene units.

        Raises
        ------
        SceneError
            As for `look_at`.
        """
        eye, axes, _ = _look(origin, target, up)
        return cls(eye, axes, Orthographic(height), size, crop)

    @classmethod
    @suggests_keywords
    def panorama(
        cls,
        origin: ArrayLike,
        target: ArrayLike | None = None,
        up: ArrayLike = (0, 1, 0),
        *,
        size: ImageSize = (1024, 512),
        crop: Window | None = None,
    ) -> Camera:
        """Place a camera that sees all directions: 360° of longitude by 180° of latitude.

        Parameters
        ----------
        origin, up, size, crop
            As for `look_at`. Pixels are square where the width is twice the height.
        target
            (3,) the point in the middle of the picture. By default the camera looks along +z; then the
            picture can be used as an `Environment`.

        Raises
        ------
        SceneError
            As for `look_at`.
        """
        if target is None:
            return cls(origin, _axes(np.array([0.0, 0.0, -1.0]), up), Panorama(), size, crop)
        eye, axes, _ = _look(origin, target, up)
        return cls(eye, axes, Panorama(), size, crop)

    @classmethod
    @suggests_keywords
    def framing(
        cls,
        scene: Any,
        view: str | ArrayLike | None = None,
        fov: float | None = None,
        *,
        size: ImageSize | None = None,
        up: ArrayLike = "auto",
        aperture: float = 0,
        focus: float | None = None,
    ) -> Camera:
        """Return the camera that `render` would choose for a scene, to change it and pass it to `render`.

        Parameters
        ----------
        scene, view, fov, size, up
            As for `render`.
        aperture, focus
            As for `look_at`; by default the middle of the framed shapes is in focus.

        Raises
        ------
        SceneError
            As `render` does.

        Examples
        --------
        >>> ball = wf.Sphere((0, 0, 0), 1)
        >>> camera = wf.Camera.framing(ball, view="front", aperture=0.2, size=64)
        >>> image = wf.render(ball, 1, camera=camera)
        """
        number("aperture", aperture)
        try:
            camera: Camera = _FRAMED[0](scene, view, fov, size, up)
        except SceneError as error:
            if not str(error).startswith("direction"):
                raise
            raise SceneError(f"view{str(error).removeprefix('direction')}") from error
        return camera.replace(aperture=aperture or None, focus=focus)

    @suggests_keywords
    def replace(
        self,
        *,
        origin: ArrayLike | None = None,
        target: ArrayLike | None = None,
        up: ArrayLike | None = None,
        fov: float | None = None,
        size: ImageSize | None = None,
        aperture: float | None = None,
        focus: float | None = None,
        shift: tuple[float, float] | None = None,
        height: float | None = None,
        projection: Projection | None = None,
        crop: Window | None = None,
        rolling_shutter: float | None = None,
    ) -> Camera:
        """Return a camera with other values of some parameters; those that are not given stay.

        Parameters
        ----------
        origin
            The camera is moved there. It is not turned, unless there is a target. One that moves then stays.
        target
            It is turned to this point, which is in focus unless `focus` says otherwise.
        up
            Up direction of the picture.
        fov, aperture, focus, shift, size, crop
            As of `look_at`. Another size has no crop, unless one is given.
        height
            As of `orthographic`.
        projection
            Another map from points of the film to rays, such as `Fisheye`, or one of your own.
        rolling_shutter
            Seconds in which the rows of the sensor are read, from the top, as of most phones and robots;
            negative from the bottom. Of h rows, row r is exposed r·rolling_shutter/h later than `shutter`
            says.

        Raises
        ------
        SceneError
            If the camera has no such parameter, or a value is out of range.

        Examples
        --------
        >>> camera = wf.Camera.look_at((0, 0, 5), (0, 0, 0))
        >>> camera.replace(fov=20, size=(64, 48))
        <Camera: Perspective(fov=20, focus=5) at (0, 0, 5) towards (0, 0, -1), 64 × 48>
        """
        eye = self.origin if origin is None else finite_array("Camera origin", origin, (3,))
        axes, lens = self.rotation, dict[str, Any]()
        base = self.projection if projection is None else projection
        if target is not None:
            eye, axes, distance = _look(eye, target, axes[:, 1] if up is None else up)
            lens = {"focus": distance} if "focus" in vars(base) and projection is None else {}
        elif up is not None:
            axes = _axes(axes[:, 2], up)
        parameters: dict[str, Any] = {"fov": fov, "aperture": aperture, "focus": focus, "shift": shift}
        parameters["height"] = height
        lens |= {name: value for name, value in parameters.items() if value is not None}
        chosen = base.replaced(**lens) if lens else base
        window = self.window if size is None and crop is None else crop
        camera = Camera(eye, axes, chosen, self.resolution if size is None else size, window)
        motion = self.motion if origin is target is up is None else None
        course = self.course if origin is target is up is None else None
        return self._carrying(camera, motion, course, rolling_shutter)

    @suggests_keywords
    def stereo(self, baseline: float) -> tuple[Self, Self]:
        """Return two parallel cameras side by side, whose pictures are rectified.

        Parameters
        ----------
        baseline
            Distance of the right camera from the left one, which is this camera; scene units.

        Returns
        -------
        left, right
            The camera itself, and one at `baseline` to its right. They move together.

        Raises
        ------
        SceneError
            If the distance is not above 0.

        Notes
        -----
        A perspective camera with K sees a point at depth z with the disparity K[0][0]·baseline/z: so many
        pixels farther to the left in the right picture.

        Examples
        --------
        >>> left, right = wf.Camera.look_at((0, 0, 4), (0, 0, 0)).stereo(0.1)
        >>> right.origin.tolist()
        [0.1, 0.0, 4.0]
        """
        aside = np.eye(4)
        aside[0, 3] = number("baseline", baseline, lambda x: x > 0, "above 0")
        right = copy(self)
        right.origin = self.origin + self.rotation[:, 0] * aside[0, 3]
        for name in ("motion", "course"):
            if getattr(self, name) is not None:
                setattr(right, name, product(getattr(self, name), aside))
        return self, right

    # --- Time -----------------------------------------------------------------------------------

    def transformed(self, matrix: ArrayLike | Motion) -> Self:
        """Return the camera, moved by a matrix, or by a motion that carries it.

        Parameters
        ----------
        matrix
            (4, 4) rotation and translation, or a motion of such, as `Keyframes`. A scale has no effect on
            what the camera sees, but on where it stands.

        Raises
        ------
        SceneError
            If it is malformed, or flattens the camera's axes.

        Examples
        --------
        >>> camera = wf.Camera.look_at((0, 0, 4), (0, 0, 0))
        >>> dolly = camera.transformed(wf.Keyframes([0, 2], [(0, 0, 0), (1, 0, 0)]))
        >>> dolly.at(1).origin.tolist()
        [0.5, 0.0, 4.0]
        """
        placement = self.to_matrix() if self.motion is None else self.motion
        moving = matrix if isinstance(matrix, Motion) else finite_array("Camera transform", matrix, (4, 4))
        placing = product(moving, placement)
        if isinstance(placing, Motion):
            camera = self._placed_by(placing.at(placing.start))
            camera.motion = placing
            return camera
        return self._placed_by(placing)

    def at(self, time: float) -> Self:
        """Return the camera at a time, seconds; one that is still returns itself."""
        if self.motion is None:
            return self
        camera = self._placed_by(self.motion.at(number("time", time)))
        camera.course = self.motion
        return camera

    @property
    def over_time(self) -> Self:
        """The camera with the motion of which it is a moment; itself if it is none."""
        if self.course is None or self.motion is not None:
            return self
        camera = copy(self)
        camera.motion = self.course
        return camera

    def _placed_by(self, matrix: Doubles) -> Self:
        """Return a still camera by its matrix (4, 4) to the world, whose scale has no effect."""
        backward, up = matrix[:3, 2], matrix[:3, 1]
        size = np.sqrt((backward * backward).sum())
        if not size > 0:
            raise SceneError(f"Camera transform takes the view to {backward.tolist()}; it must not be zero")
        camera = copy(self)
        camera.origin, camera.rotation, camera.motion = matrix[:3, 3], _axes(backward / size, up), None
        vars(camera).pop("course", None)
        return camera

    def resized(self, size: ImageSize) -> Camera:
        """Return the same camera for another (width, height) of what it renders.

        With a crop the same part of the picture is shown, to half a pixel; its height decides the scale.
        """
        width, height = image_size(size)
        if self.size == self.resolution:
            whole = Camera(self.origin, self.rotation, self.projection, (width, height))
            return self._carrying(whole, self.motion, self.course)
        x0, y0, x1, y1 = self.window
        scale = height / (y1 - y0)
        columns, left = _rescaled(self.resolution[0], (x0 + x1) / 2, scale, width)
        rows, top = _rescaled(self.resolution[1], (y0 + y1) / 2, scale, height)
        crop = left, top, left + width, top + height
        camera = Camera(self.origin, self.rotation, self.projection, (columns, rows), crop)
        return self._carrying(camera, self.motion, self.course)

    def cropped(self, crop: Window) -> Camera:
        """Return the same camera that renders only the window (x0, y0, x1, y1) of the whole picture."""
        camera = Camera(self.origin, self.rotation, self.projection, self.resolution, crop)
        return self._carrying(camera, self.motion, self.course)

    def _carrying(
        self,
        camera: Camera,
        motion: Motion | None,
        course: Motion | None,
        rolling_shutter: float | None = None,
    ) -> Camera:
        """Return another camera, which is given a motion, and this one's rolling shutter or another one."""
        camera.motion = motion
        if course is not None:
            camera.course = course
        read = self.rolling_shutter
        if rolling_shutter is not None:
            read = number("Camera rolling_shutter", rolling_shutter)
        if read:
            camera.rolling_shutter = read
        return camera

    def scaled(self, factor: float) -> Camera:
        """Return the same camera in a scene whose lengths were multiplied by `factor`."""
        if factor == 1:
            return self
        camera = copy(self)
        camera.origin, camera.projection = self.origin * factor, self.projection.scaled(factor)
        return camera

    # --- Matrices -------------------------------------------------------------------------------

    @suggests_keywords
    def intrinsics(self, pixel_centers: PixelCenters = "integer") -> Doubles:
        """Return the matrix K (3, 3) of `from_intrinsics` or `fisheye`, for the whole picture.

        Distortion is no part of it.

        Parameters
        ----------
        pixel_centers
            As for `from_intrinsics`: "integer", OpenCV's, or "half".

        Raises
        ------
        SceneError
            If the camera has neither a perspective nor a fisheye lens, or `pixel_centers` is something else.
        """
        lens = self.projection if isinstance(self.projection, Fisheye) else self._perspective()
        k = lens.matrix(self.resolution)
        k[:2, 2] -= _to_film(pixel_centers)
        return k

    def extrinsics(self) -> Doubles:
        """Return the matrix (4, 4) from the world to OpenCV's camera space: x right, y down, z forward."""
        matrix = np.eye(4)
        matrix[:3, :3] = (self.rotation * (1, -1, -1)).T
        matrix[:3, 3] = -matrix[:3, :3] @ self.origin
        return matrix

    @suggests_keywords
    def to_matrix(self, convention: Literal["opengl", "opencv"] = "opengl") -> Doubles:
        """Return the matrix (4, 4) from camera space to the world, as `from_matrix` takes it.

        Parameters
        ----------
        convention
            "opengl": x right, y up, looking along -z; "opencv": x right, y down, looking along +z.

        Raises
        ------
        SceneError
            If the convention is unknown.
        """
        matrix = np.eye(4)
        matrix[:3, :3] = self.rotation * _axes_of(convention)
        matrix[:3, 3] = self.origin
        return matrix

    @suggests_keywords
    def projection_matrix(self, near: float = 0.01, far: float = 1000) -> Doubles:
        """Return OpenGL's projection matrix (4, 4), from camera space ("opengl") to clip coordinates.

        After division by the fourth component, x from -1 to 1 is the picture from left to right, y from
        bottom to top, and z the range from `near` to `far`. Lens distortion is not included.

        Parameters
        ----------
        near, far
            Depths of the clipping planes, scene units, 0 < near < far. Pixels do not depend on them.

        Raises
        ------
        SceneError
            If the camera is not a perspective camera, or the depths are out of range.
        """
        near = number("near", near, lambda x: x > 0, "above 0")
        far = number("far", far, lambda x: x > near, f"above near, which is {near:g}")
        self._perspective()
        (fx, skew, cx), (_, fy, cy), _ = self.intrinsics("half").tolist()
        width, height = self.resolution
        return np.array(
            [
                [2 * fx / width, -2 * skew / width, 1 - 2 * cx / width, 0],
                [0, 2 * fy / height, 2 * cy / height - 1, 0],
                [0, 0, (far + near) / (near - far), 2 * far * near / (near - far)],
                [0, 0, -1, 0],
            ]
        )

    def _perspective(self) -> Perspective:
        if not isinstance(self.projection, Perspective):
            kind = type(self.projection).__name__
            raise SceneError(f"a camera with {kind} rays has no intrinsic matrix; a perspective one has")
        return self.projection

    # --- For renders ------------------------------------------------------------------------------

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) in pixels of the window that is rendered."""
        x0, y0, x1, y1 = self.window
        return x1 - x0, y1 - y0

    @property
    def fov(self) -> float:
        """Vertical field of view of the whole picture, degrees; of a perspective camera only."""
        if not isinstance(self.projection, Perspective):
            raise AttributeError(f"a camera with {type(self.projection).__name__} rays has no fov")
        return self.projection.fov

    def layers(self) -> dict[str, NDArray[Any]] | None:
        """Return the layers that the picture has from the camera itself; None where they are rendered."""
        return None

    def metadata(self) -> Mapping[str, Any]:
        """Return the entries of the picture's metadata about the camera, other than its size."""
        return {"rolling_shutter": self.rolling_shutter} if self.rolling_shutter else {}

    def row_delay(self, pixel: Words) -> Doubles:
        """Return the delays (n,) after the first row with which pixels of the whole picture are read, s."""
        width, height = self.resolution
        row = (pixel // np.uint32(width)).astype(np.float64)
        read = self.rolling_shutter
        return np.asarray((row if read > 0 else row - (height - 1)) * (read / height))

    @property
    def uses_lens(self) -> bool:
        """Whether rays start at sampled points of a lens."""
        return self.projection.uses_lens

    @property
    def tiles(self) -> Tiles:
        """The tiles of the whole picture, whose pixels may share paths."""
        return PictureTiles(*self.resolution)

    def address(self, pixel: Words) -> Words:
        """Return the row-major index (n,) in the whole picture of pixels (n,) of the window."""
        if self.size == self.resolution:
            return pixel
        x0, y0, _, _ = self.window
        width, whole = np.uint32(self.size[0]), np.uint32(self.resolution[0])
        row = pixel // width
        return ((row + np.uint32(y0)) * whole + (pixel - row * width + np.uint32(x0))).astype(np.uint32)

    @suggests_keywords
    def pixel_rays(
        self, pixel: Words, at: Floats, center: Doubles, lens: Floats | None = None
    ) -> tuple[Floats, Floats]:
        """Return origins and unit directions (3, n) of rays through points of pixels.

        Parameters
        ----------
        pixel
            (n,) row-major index in the whole picture.
        at
            (2, n) or (2, 1) position in pixels, from the upper left corner of the pixel.
        center, lens
            As for `rays`.
        """
        width = np.uint32(self.resolution[0])
        row = pixel // width
        x, y = (pixel - row * width).astype(f4) + at[0], row.astype(f4) + at[1]
        return self.rays(x, y, center, lens)

    @suggests_keywords
    def rays(
        self, x: Floats, y: Floats, center: Doubles, lens: Floats | None = None
    ) -> tuple[Floats, Floats]:
        """Return origins and unit directions (3, n) of rays through film points.

        Parameters
        ----------
        x, y
            (n,) film position in pixels, from the left and from the top of the whole picture.
        center
            (3,) the scene's center, to which the origins are relative.
        lens
            (2, n) numbers in [0, 1) that select the point on the lens; None for its center.
        """
        offset, direction = self.projection.rays(x, y, self.resolution, lens)
        eye = column(self.origin - center)
        towards = normalize(self._turned(np.asarray(direction, f4)))
        origin = np.repeat(eye, len(x), 1) if offset is None else eye + self._turned(offset)
        return origin, towards if towards.shape[1] == len(x) else np.repeat(towards, len(x), 1)

    @suggests_keywords
    def connections(
        self, points: Floats, center: Doubles, lens: Floats | None = None
    ) -> tuple[Floats, Doubles, Doubles]:
        """Connect points to the camera: return where rays end, their film points, and their importance.

        Parameters
        ----------
        points
            (3, n) relative to the scene's center.
        center, lens
            As for `rays`.

        Returns
        -------
        eye
            (3, n) origins of the camera's rays through the points, relative to the center.
        pixels
            (2, n) film positions, as `project` has them; NaN for points that no picture could show.
        importance
            (n,) area of the film, pixels², for each area across the ray at the point, scene units².
        """
        resolution, project = self.resolution, self.projection.project
        away = points.astype(np.float64) + (center - self.origin)[:, None]
        at = np.stack([away[0] * x + away[1] * y + away[2] * z for x, y, z in self.rotation.T])
        x, y = np.nan_to_num(project(at, resolution)[0]).astype(f4)
        offset, _ = self.projection.rays(x, y, resolution, lens)
        start = np.zeros_like(at) if offset is None else offset.astype(np.float64)
        with np.errstate(divide="ignore", invalid="ignore"):
            pixels, _ = project(self.projection.in_focus(at, start), resolution)
            step = STEP * np.sqrt(((start - at) ** 2).sum(0))
            moves = []
            for across in _across(start - at):
                ends = [at + across * (step * sign) for sign in (1, -1)]
                ahead, behind = (project(self.projection.in_focus(end, start), resolution)[0] for end in ends)
                moved = ahead - behind
                width = resolution[0]
                moved[0] -= width * np.rint(moved[0] / width)  # both ends of a panorama are one place
                moves.append(moved / (2 * step))
            importance = np.abs(moves[0][0] * moves[1][1] - moves[0][1] * moves[1][0])
        eye = column(self.origin - center) + self._turned(start.astype(f4))
        return eye, pixels, importance

    @suggests_keywords
    def project(self, points: ArrayLike, pixel_centers: PixelCenters = "half") -> tuple[Doubles, Doubles]:
        """Return the pixel coordinates and depths of points of the world.

        Parameters
        ----------
        points
            (n, 3) scene units.
        pixel_centers
            "half": film positions, where pixel (column, row) covers [column, column + 1] × [row, row + 1],
            so that `floor` gives the pixel, and its center is at + 0.5. "integer": what OpenCV's
            `projectPoints` returns, where `round` gives the pixel; 0.5 less.

        Returns
        -------
        pixels
            (n, 2) x from the left and y from the top of the whole picture, in pixels. Points beside the
            picture have coordinates outside of it. NaN for points that no picture could show: behind the
            camera, or where its distortion has folded.
        depth
            (n,) distance along the view axis, scene units, negative behind the camera; of a panorama or a
            fisheye the distance itself.

        Raises
        ------
        SceneError
            If the points are malformed, or `pixel_centers` is something else.
        """
        to_film = _to_film(pixel_centers)
        away = finite_array("points", points, (None, 3)) - self.origin
        pixels, depth = self.projection.project((away @ self.rotation).T, self.resolution)
        return np.ascontiguousarray(pixels.T) - to_film, depth

    def project_at(self, points: Doubles, times: Doubles) -> tuple[Doubles, Doubles]:
        """Return pixels and depths of points (n, 3) as `project`, for the camera of times (n,), seconds."""
        if self.motion is None:
            return self.project(points)
        poses = upright(self.motion.at_times(times))
        away = points - poses[:, :3, 3]
        local = (away[:, None] @ poses[:, :3, :3])[:, 0]
        pixels, depth = self.projection.project(local.T, self.resolution)
        return np.ascontiguousarray(pixels.T), depth

    def _turned(self, v: Floats) -> Floats:
        """Transform vectors (3, n) of camera space to world space."""
        right, up, backward = (column(axis) for axis in self.rotation.T)
        return right * v[0] + up * v[1] + backward * v[2]


def _across(direction: Doubles) -> tuple[Doubles, Doubles]:
    """Return two unit vectors (3, n) that are perpendicular to directions (3, n) and to each other."""
    least = np.eye(3)[np.abs(direction).argmin(0)].T
    first = np.cross(direction, least, axis=0)
    first /= np.sqrt((first**2).sum(0))
    second = np.cross(direction, first, axis=0)
    return first, second / np.sqrt((second**2).sum(0))


def _look(origin: ArrayLike, target: ArrayLike, up: ArrayLike) -> tuple[NDArray[Any], NDArray[Any], float]:
    """Return the position, the axes (3, 3) as columns, and the distance of the target."""
    eye = finite_array("Camera origin", origin, (3,))
    backward = eye - finite_array("Camera target", target, (3,))
    distance = float(np.linalg.norm(backward))
    if not distance > 0:
        raise SceneError(f"Camera origin and target are both {eye.tolist()}; they must differ")
    return eye, _axes(backward / distance, up), distance


def _axes(backward: Doubles, up: ArrayLike) -> Doubles:
    """Return the axes right, up and backward, (3, 3), as columns."""
    vertical = upward("Camera up", up)
    right = np.cross(vertical, backward)
    if not np.linalg.norm(right) > 1e-9 * np.linalg.norm(vertical):
        raise SceneError(
            f"Camera up {vertical.tolist()} must not be zero or parallel to the view; give another up="
        )
    right = right / np.linalg.norm(right)
    return np.stack([right, np.cross(backward, right), backward], 1)


def _axes_of(convention: str) -> tuple[int, int, int]:
    """Return the signs of right, up and backward in the axes x, y and z of a convention."""
    one_of("convention", convention, ("opengl", "opencv"))
    return (1, -1, -1) if convention == "opencv" else (1, 1, 1)


def _calibration(K: ArrayLike, size: tuple[int, int], pixel_centers: str) -> tuple[float, dict[str, Any]]:
    """Return the focal length, in pixels of the height, and the other parameters of a matrix K (3, 3).

    Raises
    ------
    SceneError
        If it has another form.
    """
    width, height = size
    k = finite_array("K", K, (3, 3))
    (fx, skew, cx), (zero, fy, cy), last = k.tolist()
    if zero != 0 or last != [0, 0, 1] or not (fx > 0 and fy > 0):
        raise SceneError(f"K must be [[fx, s, cx], [0, fy, cy], [0, 0, 1]], fx, fy > 0; got {k.tolist()}")
    cx, cy = cx + _to_film(pixel_centers), cy + _to_film(pixel_centers)
    shift = (0.5 - cx / width, cy / height - 0.5)
    return fy, {"shift": shift, "pixel_aspect": fy / fx, "skew": skew / fx}


def _to_film(pixel_centers: str) -> float:
    """Return the offset from pixel coordinates with these centers to film positions."""
    return CENTERS[one_of("pixel_centers", pixel_centers, tuple(CENTERS))]


def _rigid(name: str, value: ArrayLike) -> tuple[Doubles, Doubles]:
    """Return rotation (3, 3) and position (3,) of a (4, 4) or (3, 4) matrix."""
    rows = 3 if as_array(name, value).shape == (3, 4) else 4
    matrix = finite_array(name, value, (rows, 4))
    if rows == 4 and matrix[3].tolist() != [0, 0, 0, 1]:
        raise SceneError(f"{name}[3] is {matrix[3].tolist()}; it must be [0, 0, 0, 1]")
    return rotation_matrix(f"{name}[:3, :3]", matrix[:3, :3]), matrix[:3, 3]


def _extrinsics(R: ArrayLike, t: ArrayLike | None) -> tuple[Doubles, Doubles]:
    """Return rotation (3, 3) and translation (3,) from world to camera space."""
    if as_array("R", R).shape in ((4, 4), (3, 4)):
        if t is not None:
            raise SceneError(f"R has the shape {np.shape(R)} and holds a translation; leave t out")
        return _rigid("R", R)
    axes = rotation_matrix("R", R)
    if t is None:
        raise SceneError("from_intrinsics needs t, or both in one matrix R of shape (4, 4) or (3, 4)")
    return axes, finite_array("t", np.ravel(t) if as_array("t", t).shape in ((3, 1), (1, 3)) else t, (3,))


def upward(name: str, value: ArrayLike) -> Doubles:
    """Return the up vector of a picture, (3,) of any length, from a vector or the name of an axis.

    Raises
    ------
    SceneError
        If it is neither, or zero.
    """
    if isinstance(value, str):
        axis = value.lower().removeprefix("+")
        if axis.removeprefix("-") not in ("x", "y", "z"):
            raise SceneError(f"{name} is {value!r}; it must be a vector, or one of x, y, z, -x, -y, -z")
        return np.eye(3)["xyz".index(axis[-1])] * (-1.0 if axis[0] == "-" else 1.0)
    if as_array(name, value).ndim == 0:
        raise SceneError(
            f"{name} is {value!r}; it must be a vector (3,) or the name of an axis. "
            "A field of view is given by name: fov=40"
        )
    vector = finite_array(name, value, (3,))
    if not vector.any():
        raise SceneError(f"{name} {vector.tolist()} must not be zero or parallel to the view")
    return vector


def field_of_view(fov: float) -> float:
    """Return a field of view in degrees; warn of one that looks like radians.

    Raises
    ------
    SceneError
        If it is not above 0 and below 180.
    """
    degrees = number("Camera fov", fov, lambda x: 0 < x < 180, "above 0 and below 180 degrees")
    low, high = RADIANS
    if low <= degrees < high and degrees != int(degrees):
        warn_caller(
            f"Camera fov is {degrees:.4g} degrees; if these are radians, pass np.degrees({degrees:.4g}), "
            f"which is {np.degrees(degrees):.4g}"
        )
    return degrees


def check_camera(name: str, value: Any) -> Camera | None:
    """Check that something is a camera, or None."""
    if value is not None and not isinstance(value, Camera):
        raise SceneError(
            f"{name} must be a wf.Camera, got {in_brief(value)}; wf.Camera.look_at(origin, target) makes one"
        )
    return value


def image_size(size: ImageSize) -> tuple[int, int]:
    """Return (width, height) as ints; one number means a square.

    Raises
    ------
    SceneError
        If they are not two whole numbers from 1 to 65536.
    """
    try:
        width, height = (size, size) if isinstance(size, int | np.integer) else size
        whole = int(width) == width and int(height) == height
        whole &= not isinstance(width, bool | np.bool_) and not isinstance(height, bool | np.bool_)
    except (TypeError, ValueError, OverflowError) as error:
        raise SceneError(f"size must be (width, height) or one number for both, got {size!r}") from error
    if not whole or not (1 <= width <= MAX_SIDE and 1 <= height <= MAX_SIDE):
        raise SceneError(f"size is {size!r}; both must be whole numbers from 1 to {MAX_SIDE}")
    return int(width), int(height)


def _rescaled(whole: int, middle: float, scale: float, size: int) -> tuple[int, int]:
    """Return the pixels along a side of a scaled picture, and the first of `size` of them around a place.

    The side is longer on both ends where they would not fit.
    """
    length, first = round(whole * scale), round(middle * scale - size / 2)
    beyond = max(0, -first, first + size - length)
    return length + 2 * beyond, first + beyond


def _window(crop: Window | None, resolution: tuple[int, int]) -> Window:
    """Return the window that is rendered.

    Raises
    ------
    SceneError
        If it is not four whole numbers, is empty, or leaves the picture.
    """
    width, height = resolution
    if crop is None:
        return 0, 0, width, height
    try:
        x0, y0, x1, y1 = (int(side) for side in crop)
        whole = all(int(side) == side for side in crop)
    except (TypeError, ValueError, OverflowError) as error:
        raise SceneError(f"crop must be (x0, y0, x1, y1), got {crop!r}") from error
    if not whole or not (0 <= x0 < x1 <= width and 0 <= y0 < y1 <= height):
        raise SceneError(
            f"crop is {crop!r}; it must be whole numbers (x0, y0, x1, y1) with "
            f"0 <= x0 < x1 <= {width} and 0 <= y0 < y1 <= {height}"
        )
    return x0, y0, x1, y1
