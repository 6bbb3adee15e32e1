"""OpenSplat's CPU rasteriser beside ours, through a library that the user has built.

OpenSplat is under the AGPL: none of it is here. ``OPENSPLAT_LIBRARY`` names a shared library that
registers the PyTorch operators of README.md. It samples pixel j at x = j and a mean at
f x/z + c - 0.5, which is our pixel centre at j + 0.5. Its rasteriser starts one thread per core of
the machine, whatever ``torch.set_num_threads`` says.
"""

import os
from dataclasses import dataclass, fields
from pathlib import Path

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.geometry.camera import Camera
from diff4splat.scene.gaussians import Gaussians

NAME = "opensplat"
NOTE = "own threads, one per core; stops at light 1e-4; support 3 sigma + 2 px; halves one gradient"
OPERATORS = ("forward", "differentiable")
_LIBRARY = "OPENSPLAT_LIBRARY"
_NEAR, _FAR = 0.001, 1000.0


def unavailable() -> str | None:
    """One line why OpenSplat cannot run here; None when it can."""
    path = os.environ.get(_LIBRARY, "")
    if not path:
        return f"{_LIBRARY}: expected the path of a built library, got nothing; see README.md"
    if not Path(path).is_file():
        return f"{_LIBRARY}: expected a file, got {path}"
    try:
        torch.ops.load_library(path)
    except OSError as error:
        return f"{_LIBRARY}: {path} does not load: {str(error).splitlines()[0]}"
    missing = [name for name in OPERATORS if not hasattr(torch.ops.opensplat, name)]
    return f"{_LIBRARY}: {path} lacks {', '.join(missing)}" if missing else None


@dataclass(frozen=True, slots=True, kw_only=True)
class Prepared:
    """A scene and a view in OpenSplat's form; opacities are a column, as in its model."""

    parameters: dict[str, Tensor]
    """The leaves, by the names of ``Gaussians``."""
    view: tuple[Tensor | float | int, ...]
    """Everything that the operators take after the parameters."""

    def forward(self) -> Float[Tensor, "h w 3"]:
        """RGB over black without a graph."""
        return torch.ops.opensplat.forward(*self.parameters.values(), *self.view)

    def forward_backward(self, grad_rgb: Float[Tensor, "h w 3"]) -> Gaussians:
        """Gradient of Σ rgb · grad_rgb for every parameter."""
        rgb = torch.ops.opensplat.differentiable(*self.parameters.values(), *self.view)
        leaves = tuple(self.parameters.values())
        found = dict(zip(self.parameters, torch.autograd.grad(rgb, leaves, grad_rgb), strict=True))
        return Gaussians(**(found | {"opacities": found["opacities"][:, 0]}))


def prepare(gaussians: Gaussians, camera: Camera) -> Prepared:
    """Leaves in float32 and the camera in OpenSplat's form; nothing of it is rendering."""
    torch.ops.load_library(os.environ[_LIBRARY])
    values = {f.name: getattr(gaussians, f.name).detach().float() for f in fields(Gaussians)}
    values["opacities"] = values["opacities"][:, None]
    leaves = {
        name: value.clone(memory_format=torch.contiguous_format).requires_grad_()
        for name, value in values.items()
    }
    camera = camera.to(torch.float32)
    view = (
        camera.camera_from_world.contiguous(),
        _projection(camera),
        camera.position.contiguous(),
        torch.zeros(3),
        *camera.focal_px.tolist(),
        *camera.size_px,
        gaussians.degree,
    )
    return Prepared(parameters=leaves, view=view)


def _projection(camera: Camera) -> Float[Tensor, "4 4"]:
    """Camera space to clip space, y down, w = z; holds the principal point, which its own lacks."""
    height, width = camera.size_px
    (focal_x, focal_y), (center_x, center_y) = camera.focal_px.tolist(), camera.center_px.tolist()
    depth = _FAR - _NEAR
    return torch.tensor(
        [
            [2 * focal_x / width, 0, 2 * center_x / width - 1, 0],
            [0, 2 * focal_y / height, 2 * center_y / height - 1, 0],
            [0, 0, (_FAR + _NEAR) / depth, -_FAR * _NEAR / depth],
            [0, 0, 1, 0],
        ]
    )
