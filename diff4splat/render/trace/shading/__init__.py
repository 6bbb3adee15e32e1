"""Colours along rays, forward and backward."""
