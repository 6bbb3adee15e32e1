"""Images with and without one object."""
