"""A network on a larger image backbone that starts where the bundled one ends."""
