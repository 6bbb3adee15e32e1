"""Depth networks of others as ONNX graphs: recognised, checked, run."""
