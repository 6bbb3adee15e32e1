"""Error against run time, stability, and what was left out."""
