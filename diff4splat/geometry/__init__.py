"""Rotations, rigid motions, cameras, rays and depth; see docs/reference/conventions.md."""
