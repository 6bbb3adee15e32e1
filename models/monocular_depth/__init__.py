"""Depth of one image: the depth prior."""
