"""Readers of training data sets: each yields clips, one window of frames at a time."""
