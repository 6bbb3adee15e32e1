"""Model folders: reading, checking, writing."""
