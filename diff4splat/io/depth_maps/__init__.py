"""Depth maps of any tool: OpenEXR, PNG and NumPy arrays."""
