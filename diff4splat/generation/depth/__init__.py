"""Depth of one image by the depth prior: several passes fused, and shrunk where unsure."""
