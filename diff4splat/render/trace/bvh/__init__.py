"""Bounding volume hierarchy over Gaussians: order, boxes and leaves."""
