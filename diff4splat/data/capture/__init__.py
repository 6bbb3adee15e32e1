"""Captures: posed, timed images of one scene, which per-scene fitting learns from."""
