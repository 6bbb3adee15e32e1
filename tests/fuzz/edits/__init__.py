"""Edits of contents and of whole files, by what they know of the format."""
