"""Endings of files of Gaussians at one moment; imports no library."""

SPLAT_SUFFIXES = (".ply", ".spz", ".glb")
