"""The shadow that one object of an image casts."""
