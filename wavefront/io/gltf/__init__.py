"""Scenes of glTF 2.0."""
