"""Gaussians of one moment in the files of other programs."""
