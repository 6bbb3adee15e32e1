"""Evaluation protocols: bundled JSON files, their types, and the clips that they name."""
