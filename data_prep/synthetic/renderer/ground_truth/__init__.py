"""Depth, instances, flow and point tracks that follow from the triangles."""
