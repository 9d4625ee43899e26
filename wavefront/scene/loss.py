"""Losses: parts of a file that a scene does not show as the file says."""

from __future__ import annotations

import os
from dataclasses import dataclass

NOT_HONORED = "not honored"


@dataclass(frozen=True)
class Loss:
    """A part of a file that is damaged, unknown or not supported, and what was done about it.

    `Scene.losses` lists them, and one warning of `load` names them.

    Parameters
    ----------
    place
        The file, and where in it: a line or an element.
    part
        The part of the file.
    value
        The value that was found, as text; "" where there is none to name.
    done
        The remedy; "not honored" where the part has no effect.

    Examples
    --------
    >>> with open("triangle.obj", "w") as file:
    ...     _ = file.write("v 0 0 0\\nv 1 0 0\\nv 0 1 0\\nf 1 2 3\\nl 1 2\\n")
    >>> import warnings
    >>> with warnings.catch_warnings():
    ...     warnings.simplefilter("ignore")
    ...     scene = wf.load("triangle.obj")
    >>> for loss in scene.losses:
    ...     print(loss.place, "/", loss.part, "/", loss.done)
    triangle.obj: line 5 / l / not honored
    """

    place: str
    part: str
    value: str = ""
    done: str = ""

    def said(self, file: str) -> str:
        """Return the line of a message about a file, without its name and folder."""
        folder = os.path.join(os.path.dirname(file), "")
        where = self.place.removeprefix(file).lstrip(":, ").removeprefix(folder)
        what = f"{self.part} is {self.value}" if self.value else self.part
        text = f"{where}: {what}" if where else what
        if self.done == NOT_HONORED:
            return f"{NOT_HONORED}: {text}"
        return f"{text}; {self.done}" if self.done else text
