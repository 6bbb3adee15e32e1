"""Procedural worlds: dynamic multi-view clips with exact truth, without end."""
