"""Reading of scene files: meshes, materials, lights, cameras."""
