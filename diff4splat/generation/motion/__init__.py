"""What moves in a single image, and where to: one prior, sampled and brought to every grid."""
