"""Sorted lists of Gaussians per tile, and their blending, forward and backward."""
