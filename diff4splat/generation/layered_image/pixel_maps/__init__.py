"""Depth and displacement of the image's own pixels, from maps of cells."""
