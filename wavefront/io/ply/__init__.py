"""Meshes and points of PLY."""
