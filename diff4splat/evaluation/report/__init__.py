"""Summary of results, and the files that show it."""
