"""Captures in the formats of this library: clip folders and camera.json."""
