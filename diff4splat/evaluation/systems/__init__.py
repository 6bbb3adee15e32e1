"""Evaluated systems, baselines and their predictions."""
