"""Stability report: extreme and degenerate inputs against float64."""
