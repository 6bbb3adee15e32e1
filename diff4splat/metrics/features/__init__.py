"""Perceptual distances: LPIPS with weights that a user has, and an honest stand-in without."""
