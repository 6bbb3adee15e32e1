"""What lies beyond the border of an image: fine cells beside it, coarse ones farther out."""
