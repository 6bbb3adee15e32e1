"""Rays in world space, one by one: what any camera, lens or shutter turns into.

Axes: ``r`` rays. A point of a ray is origin + distance · direction with a unit direction, so
distances are in scene units along the ray, and not z.
"""

from dataclasses import dataclass, fields, replace

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from diff4splat.errors import InputError, ShapeError
from diff4splat.render.projection import TOO_LARGE
from diff4splat.render.saturate import saturate_


@dataclass(frozen=True, slots=True, kw_only=True)
class Rays:
    """Half lines; directions are normalised here.

    Raises:
        ShapeError: numbers of rays, dtypes or devices differ, or the dtype is half precision.
        InputError: a valid ray is not finite, starts too far away, or has a direction of zero.
    """

    origins: Float[Tensor, "r 3"]
    directions: Float[Tensor, "r 3"]
    valid: Bool[Tensor, " r"] | None = None
    """Rays that exist; the others, as outside the image circle of a lens, see nothing at all and
    may hold any numbers. None is all of them."""
    time_s: Float[Tensor, " r"] | None = None
    """Time of each ray; required if Gaussians move."""

    def __post_init__(self) -> None:
        _require_shapes(self)
        valid = self.valid
        origins, directions, time_s = self.origins, self.directions, self.time_s
        if valid is not None:
            origins = torch.where(valid[:, None], origins, 0.0)
            directions = torch.where(valid[:, None], directions, _forward(directions))
            time_s = None if time_s is None else torch.where(valid, time_s, 0.0)
        _require_finite(origins, directions, time_s)
        # Dividing by the largest entry first keeps tiny and huge ones from under- and overflowing.
        largest = directions.detach().abs().amax(1, keepdim=True)
        if directions.requires_grad:
            directions = directions.view_as(directions)  # hooks on leaves would stay there
            directions.register_hook(_saturated)
        object.__setattr__(self, "origins", origins)
        object.__setattr__(
            self, "directions", torch.nn.functional.normalize(directions / largest, dim=1)
        )
        object.__setattr__(self, "time_s", time_s)

    def __len__(self) -> int:
        return self.origins.shape[0]

    def select(self, index: Bool[Tensor, " r"] | Int[Tensor, " m"] | slice) -> "Rays":
        """The rays under a mask or at indices."""
        values = {f.name: getattr(self, f.name) for f in fields(self)}
        return replace(self, **{k: None if v is None else v[index] for k, v in values.items()})


def _saturated(gradient: Tensor | None) -> Tensor | None:
    return None if gradient is None else saturate_(gradient.clone())


def _require_shapes(rays: Rays) -> None:
    count = rays.origins.shape[:1]
    want = {"origins": (*count, 3), "directions": (*count, 3), "valid": count, "time_s": count}
    for name, shape in want.items():
        got = getattr(rays, name)
        if got is not None and tuple(got.shape) != tuple(shape):
            raise ShapeError(f"Rays.{name}: expected {tuple(shape)}, got {tuple(got.shape)}")
    numbers = [rays.origins, rays.directions, *([] if rays.time_s is None else [rays.time_s])]
    kinds = {(tensor.dtype, tensor.device) for tensor in numbers}
    if len(kinds) != 1 or rays.origins.dtype not in (torch.float32, torch.float64):
        got = ", ".join(sorted(f"{dtype} on {device}" for dtype, device in kinds))
        raise ShapeError(f"Rays: expected one dtype, float32 or float64, on one device, got {got}")


def _require_finite(
    origins: Float[Tensor, "r 3"],
    directions: Float[Tensor, "r 3"],
    time_s: Float[Tensor, " r"] | None,
) -> None:
    numbers = [origins, directions, *([] if time_s is None else [time_s[:, None]])]
    if not bool(torch.isfinite(torch.cat([tensor.detach() for tensor in numbers], 1)).all()):
        raise InputError("Rays: expected finite origins, directions and times of the valid rays")
    if bool((origins.detach().abs() >= TOO_LARGE).any()):
        raise InputError(f"Rays.origins: expected coordinates below {TOO_LARGE:g}, got larger ones")
    if bool((directions.detach() == 0).all(1).any()):
        raise InputError("Rays.directions: expected lengths above 0 in the valid rays, got 0")


def _forward(directions: Float[Tensor, "r 3"]) -> Float[Tensor, " 3"]:
    return directions.new_tensor([0.0, 0.0, 1.0])
