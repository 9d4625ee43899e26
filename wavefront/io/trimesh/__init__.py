"""Objects of `trimesh`, and files that it reads."""
