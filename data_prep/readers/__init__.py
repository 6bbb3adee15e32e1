"""Readers of captures: posed, timed images in the layouts that data sets and tools use."""
