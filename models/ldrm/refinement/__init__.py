"""From tokens, pictures and cameras to Gaussians with sharp edges (ours, after MVSplat)."""
