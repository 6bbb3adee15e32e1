"""Photographs: read, validate, convert; write PNG."""
