"""Refinement of tokens with frames and cameras to Gaussians with sharp edges (after MVSplat)."""
