"""Gaussians as INRIA PLY files."""
