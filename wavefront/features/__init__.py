"""Rare properties of scenes, a file each: when a scene has one, and where it acts. See compile/program.py."""
