"""Captures in COLMAP models: text and binary files, rigs and videos."""
