"""Our fast CPU renderer, through the public ``render``."""

from torch_backward import TorchPrepared

from diff4splat.geometry.camera import Camera
from diff4splat.render.api import render
from diff4splat.render.backends import BACKENDS
from diff4splat.scene.gaussians import Gaussians

NAME = "raster"


def unavailable() -> str | None:
    """Only while the back end does not exist."""
    return None if NAME in BACKENDS else "diff4splat has no back end called raster yet"


def prepare(gaussians: Gaussians, camera: Camera) -> TorchPrepared:
    """Nothing to convert."""
    return TorchPrepared(
        gaussians=gaussians, draw=lambda these: render(these, camera, backend=NAME).rgb
    )
