"""Matched sequences of one scene: the same path and times through cameras that differ."""
