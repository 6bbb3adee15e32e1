"""Lenses: between image-plane coordinates and directions, both ways; see ``protocol``."""
