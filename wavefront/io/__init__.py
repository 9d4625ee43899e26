"""Files: meshes and materials in, images in and out."""
