"""Rotations, rigid motions, cameras, rays and depth; see docs/conventions.md."""
