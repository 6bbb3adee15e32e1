"""Our reference renderer in PyTorch, through the public ``render``."""

from torch_backward import TorchPrepared

from diff4splat.geometry.camera import Camera
from diff4splat.render.api import render
from diff4splat.scene.gaussians import Gaussians

NAME = "reference"


def unavailable() -> str | None:
    """It runs wherever diff4splat does."""


def prepare(gaussians: Gaussians, camera: Camera) -> TorchPrepared:
    """Nothing to convert."""
    return TorchPrepared(
        gaussians=gaussians, draw=lambda these: render(these, camera, backend=NAME).rgb
    )
