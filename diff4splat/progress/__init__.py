"""Progress, seconds per phase, and what a run skipped."""
