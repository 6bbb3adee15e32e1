"""Captions from side-car files or from a user's model, into the records of clips."""
