"""Fitting one scene to one capture: 4D Gaussians with a HexPlane field, and native 4D Gaussians."""
