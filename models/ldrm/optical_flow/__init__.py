"""Optical flow between two images: gradients, and blocks where displacements are large."""
