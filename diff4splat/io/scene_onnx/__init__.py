"""Scenes as ONNX graphs: time in, Gaussians out."""
