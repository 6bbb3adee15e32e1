"""Comparisons behind consistency_check."""
