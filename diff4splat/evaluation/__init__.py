"""Evaluation of models on a fixed, versioned set of clips, with trivial baselines beside them."""
