"""From PyTorch networks to ONNX graphs."""
