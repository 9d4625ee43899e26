"""What a file says of a scene, in the terms of this package: importers fill it, whatever their format."""
