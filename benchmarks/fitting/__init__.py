"""Fits of procedural worlds: quality on held-out views, ablations, memory."""
