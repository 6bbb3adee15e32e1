"""Metrics of one item: images, depth, camera steps, point tracks, motion and text."""
