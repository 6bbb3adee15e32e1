"""Losses as pure functions: one value per batch element."""
