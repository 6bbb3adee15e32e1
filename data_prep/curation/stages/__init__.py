"""One stage of scoring per file: a clip with its record goes in, the same with more scores out."""
