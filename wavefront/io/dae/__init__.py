"""Scenes of COLLADA, read by `pycollada`."""
