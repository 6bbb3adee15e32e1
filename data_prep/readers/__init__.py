"""Readers of captures: posed, timed pictures in the layouts that data sets and tools use."""
