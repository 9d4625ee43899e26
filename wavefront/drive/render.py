"""render(): one call over a session."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Unpack

from ..image import Image
from ..settings import RenderSettings, takes_settings
from .final_checks import interrupted
from .notebook import run_shown, shows_pictures
from .session import Session


@takes_settings
def render(scene: Any, spp: int | None = None, **settings: Unpack[RenderSettings]) -> Image:
    """Render a picture.

    Parameters
    ----------
    scene
        A `Scene`, the path of a mesh file, a `trimesh.Trimesh` or `trimesh.Scene`, a pair
        (vertices, faces), a shape, or a list of these.
    {settings}

    Returns
    -------
    Image

    Raises
    ------
    SceneError
        If an argument or the scene is malformed. It is a ValueError.
    Interrupted
        After Ctrl-C, within about two seconds; at a second Ctrl-C at once. It is a KeyboardInterrupt,
        and its `image` is the picture so far.
    RenderError
        If the render cannot go on: memory runs out, worker processes die again and again, more than
        1e-4 of the samples are not finite, or `seconds` are over before there is one sample. Its
        `image` is the picture so far.

    Examples
    --------
    >>> ball = wf.Sphere((0, 0, 0), 1, material=wf.Diffuse(0.5))
    >>> image = wf.render([ball, wf.Environment(1)], spp=4, size=(32, 24))
    >>> image.rgb.shape
    (24, 32, 3)
    """
    shown = shows_pictures(settings.get("progress"))
    if shown:
        settings["progress"] = False
    session = Session(scene, spp, **settings)
    return finish(session, run_shown if shown else Session.run_once)


def finish(session: Session, run: Callable[[Session], Image] = Session.run_once) -> Image:
    """Have a function render a session to the end, close it and return the picture, as `render` does."""
    with session.interrupt_handler as ctrl_c:  # until the last worker has ended
        with session:
            image = run(session)
        if ctrl_c.pressed:
            raise interrupted(image, None)
    return image
