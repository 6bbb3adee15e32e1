"""Cameras, lenses, optics and camera paths as files."""
