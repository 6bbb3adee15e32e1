"""Pieces of triangle mesh: flat faces, revolved profiles, tubes along a path."""
