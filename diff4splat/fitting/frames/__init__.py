"""Frames of a capture: loading, scheduling, unprojection and rendering."""
