"""Worker processes: one generation each, started before it is needed."""
