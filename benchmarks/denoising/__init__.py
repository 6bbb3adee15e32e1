"""Tiny networks of public families in their own loop and in ours."""
