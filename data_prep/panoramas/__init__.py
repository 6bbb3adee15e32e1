"""Photographs cut from panoramas."""
