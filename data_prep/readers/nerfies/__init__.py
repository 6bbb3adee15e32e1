"""Captures in the layout of Nerfies and HyperNeRF."""
