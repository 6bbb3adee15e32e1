"""What a run writes: log rows, curves, panels."""
