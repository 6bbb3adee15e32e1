"""Depth that a relative disparity can be fitted to: one map per frame, 0 where unknown."""
