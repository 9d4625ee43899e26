"""Scene files of pbrt-v4."""
