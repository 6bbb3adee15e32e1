"""Shadows of what moves: taken off the ground, and moved along with the object that casts them."""
