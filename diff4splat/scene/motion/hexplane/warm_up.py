"""Warm-up of the HexPlane kernels: features of one point, and their gradients."""

import torch

from diff4splat.scene.motion.hexplane.compiled_features import features


def warm_up() -> None:
    """Call every HexPlane kernel once."""
    point = torch.zeros(1, 3, device="cpu", dtype=torch.float32, requires_grad=True)
    tables = [torch.zeros(2, 2, 16, device="cpu", dtype=torch.float32) for _ in range(6)]
    features(point, tables).sum().backward()
