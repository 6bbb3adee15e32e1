"""Checkpoints of other 4D Gaussian programs."""
