"""Scenes through physical cameras: lenses, apertures, shutters, exposures."""
