"""Materials by the keywords of MTL: of its files, and of trimesh, which keeps their lines."""
