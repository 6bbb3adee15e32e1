"""The object shadow: where its training starts, and what it explains."""
