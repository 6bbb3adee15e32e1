"""Colours of images: light, shadow, sky and tone."""
