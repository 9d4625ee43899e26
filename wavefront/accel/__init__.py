"""Ray queries: which surface a ray meets first, and whether anything blocks it."""
