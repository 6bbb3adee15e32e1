"""Measures of images, video, depth, poses and motion."""
