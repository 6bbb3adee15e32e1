"""Rendering: one API, several back ends; the reference is plain PyTorch."""
