"""Objects and plotters of `pyvista`."""
