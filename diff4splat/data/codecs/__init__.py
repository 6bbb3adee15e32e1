"""Encoding and decoding of the members of a clip."""
