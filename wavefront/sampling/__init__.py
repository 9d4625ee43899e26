"""Random numbers by address, and the maps that turn them into directions, points and choices."""
