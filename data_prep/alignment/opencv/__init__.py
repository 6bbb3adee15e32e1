"""Flow, matches and poses by OpenCV, without weights: every step runs on a plain video."""
