"""Renderer of procedural worlds: images, depth, instances, flow and tracks from triangles."""
