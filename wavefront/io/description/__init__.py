"""The description of a scene, which importers of all formats fill, in the terms of this package."""
