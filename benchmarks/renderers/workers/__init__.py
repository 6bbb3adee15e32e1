"""Processes that hold one renderer each."""
