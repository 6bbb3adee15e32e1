"""Learned camera parameters: lens, focus, aperture, read-out and focal length."""
