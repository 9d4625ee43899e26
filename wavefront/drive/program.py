"""program(): which stages and features run for a scene."""

from __future__ import annotations

from typing import Any, Unpack

from ..integrators.stage_list import StageList
from ..settings import RenderSettings, takes_settings
from .session import Session


@takes_settings
def program(scene: Any, **settings: Unpack[RenderSettings]) -> StageList:
    """List the stages that run for a scene, and the features that act between them.

    Parameters
    ----------
    scene
        As for `render`.
    {settings}

    Returns
    -------
    StageList
        Print it: each stage and feature with its file and a sentence.

    Raises
    ------
    SceneError
        As `render`.

    Examples
    --------
    >>> glass = wf.Material(wf.Dielectric(1.5), alpha=0.5)
    >>> stages = wf.program([wf.Sphere((0, 0, 0), 1, material=glass), wf.Environment(1)], size=(8, 8))
    >>> [stage.name for stage in stages if stage.point]
    ['Alpha', 'Passing']
    """
    with Session(scene, **settings) as session:
        return session.stages
