"""Learned motions: their parameters, and the ``Motion`` of the current values."""
