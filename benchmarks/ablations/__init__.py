"""Variants of the reconstruction, trained at equal compute and evaluated on the same clips."""
