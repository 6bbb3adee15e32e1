"""Cameras of a capture while they are learned: lens, focus, aperture, read-out and focal length."""
