"""What is true of an image at some of its pixels, and how far a renderer is from it."""
