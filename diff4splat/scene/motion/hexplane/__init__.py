"""Motion as a field on six planes of space-time, decoded by a small network."""
