"""Surfaces that only the true offset of inverse depth makes regular: spheres, cylinders, boxes."""
