"""`mesh.wavefront.render(...)` and `plotter.wavefront.render(...)`: PyVista imports this by entry points."""

from __future__ import annotations

from typing import Any

import pyvista

from ..drive.render import render
from ..image import Image
from ..io.pyvista.objects import from_pyvista
from ..scene import Scene


class Accessor:
    """What datasets and plotters of PyVista, from 0.48 on, have as `wavefront`.

    Parameters
    ----------
    shown
        The dataset or plotter.
    """

    def __init__(self, shown: Any) -> None:
        self._shown = shown

    def render(self, spp: int | None = None, **settings: Any) -> Image:
        """Render a picture, as `wavefront.render` does of what this belongs to."""
        image: Image = render(self._shown, spp, **settings)
        return image

    def view(self, **settings: Any) -> Any:
        """Show it in a window of the browser, as `wavefront.view` does."""
        from ..viewer import view  # here, as it needs viser

        return view(self._shown, **settings)

    def scene(self, **arguments: Any) -> Scene:
        """Return it as a `wavefront.Scene`, as `wavefront.from_pyvista` does."""
        return from_pyvista(self._shown, **arguments)


class PlotterAccessor(Accessor):
    """The same of plotters: each class has one registry."""


pyvista.register_dataset_accessor("wavefront", pyvista.DataObject)(Accessor)
pyvista.register_plotter_component("wavefront")(PlotterAccessor)
