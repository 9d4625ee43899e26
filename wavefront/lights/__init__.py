"""Lights, and how one of them is chosen."""
