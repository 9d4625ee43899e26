"""AOVs, the layers beside the picture: what is known of surfaces, and of light, along the paths."""
