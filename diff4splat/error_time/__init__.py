"""Error against run time of every approximation."""
