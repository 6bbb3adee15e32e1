"""Clips encoded once and for all: what the video model learns from without reading images."""
