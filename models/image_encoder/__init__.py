"""Encoder of images whose states a video model attends to."""
