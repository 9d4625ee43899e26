"""AOVs, the layers beside the picture: data of surfaces, and of light, along the paths."""
