"""Gaussians to 2D footprints and colours, forward and backward."""
