"""Alignment of relative disparity under contamination, method beside method."""
