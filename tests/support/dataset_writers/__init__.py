"""One writer per format, from the descriptions of the formats; none uses a reader."""
