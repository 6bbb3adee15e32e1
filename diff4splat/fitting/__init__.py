"""Per-scene optimisation: fits 4D Gaussians to one capture of posed, timed frames."""
