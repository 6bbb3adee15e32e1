"""Names of what commands write; imports no library."""

from diff4splat.io.movies.suffixes import VIDEO_SUFFIXES

VIDEO_FILES = tuple(f"video{suffix}" for suffix in VIDEO_SUFFIXES)
"""Of which a run writes one."""
MORE_FILES = ("scene.html", "depth.exr", "scene.ply", "preview.png")
OUTPUT_FILES = ("scene.safetensors", *VIDEO_FILES, *MORE_FILES, "card.json")
"""Files of a generated scene."""
VIEW_SUFFIXES = (*VIDEO_SUFFIXES, ".png", ".exr")
"""Endings of a rendered file: a video, an image or several, or depth."""
