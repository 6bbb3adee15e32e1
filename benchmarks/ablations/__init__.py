"""Variants of the reconstruction, trained at equal compute and judged on the same clips."""
