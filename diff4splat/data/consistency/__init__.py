"""Comparisons behind the consistency check."""
