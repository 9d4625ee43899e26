"""Scenes of USD, read by `usd-core`."""
