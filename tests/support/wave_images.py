"""An image of smooth waves, which no surface of a scene follows."""

import torch

from diff4splat.generation.inputs.input_image import InputImage
from diff4splat.geometry.camera import pinhole


def waves(side_px: int) -> InputImage:
    """Colours that no surface ends with, some as bright and dark as there are."""
    y, x = torch.meshgrid(*(torch.linspace(0, 9, side_px),) * 2, indexing="ij")
    rgb = torch.stack([x.sin(), (x + y).cos(), (y * 2).sin()], -1) * 0.55 + 0.5
    camera = pinhole(1.2 * side_px, (side_px, side_px))
    return InputImage(rgb=rgb.clamp(0, 1), camera=camera, focal_source="test")
