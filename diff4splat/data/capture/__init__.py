"""Captures: posed, timed pictures of one scene, which per-scene fitting learns from."""
