"""Clips: the contract between what prepares training data and what reads it."""
