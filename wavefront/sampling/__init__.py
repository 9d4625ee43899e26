"""Random numbers by address, and the warps that map them to directions, points and choices."""
