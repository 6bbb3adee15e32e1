"""Judging models on a fixed, versioned set of clips, with trivial baselines in the same table."""
