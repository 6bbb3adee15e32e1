"""SPZ, the compressed splat file of Niantic."""
