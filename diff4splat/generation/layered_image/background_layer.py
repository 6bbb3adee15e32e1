"""What shows between the pixels of one picture: a second, softer layer right behind them (ours).

Axes: ``h w`` pixels, ``k`` = AROUND² of them around each, ``n`` = h w. Small Gaussians keep a
picture sharp but let light through as soon as they part, on every surface that is seen from nearer
or more from the front. Behind each pixel therefore stands a larger one, behind all that is near it
in the picture, so that it can only be seen through gaps. Where the pixel's own surface goes on it
has its colour and moves with it; in front of an edge of depth it belongs to what lies behind and
has the colour of that. No gradient passes.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from diff4splat.geometry.camera import Camera, stack_cameras
from diff4splat.geometry.depth import distance_from_depth
from diff4splat.models.config.networks import GAUSSIAN_SPLIT, ActivationConfig
from diff4splat.models.ldrm.gaussian_head import PixelBase, activate
from diff4splat.models.ldrm.plane_prior import OPAQUE
from diff4splat.scene.gaussians import Gaussians

AROUND = 7
"""Pixels on a side of what is near."""
BEHIND = 1.03
"""Depth over that of the farthest pixel near it."""
ONE_SURFACE = 0.15
"""Difference of log depth up to which pixels belong to what lies behind."""
FOOTPRINT_PX = 0.5
REACH_PX = 1.0
"""Standard deviation with which near pixels lend their colour."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BackgroundLayer:
    """The layer."""

    gaussians: Gaussians
    cells: Int[Tensor, " n"]
    """The pixel with which each moves; the number after the last where it stands."""


@torch.no_grad()
def background_layer(
    rgb: Float[Tensor, "h w 3"], depth: Float[Tensor, "h w"], camera: Camera
) -> BackgroundLayer:
    """The layer behind a picture of depth z ``depth``, above 0."""
    farthest, shares, own = _behind(depth)
    colors = _around(rgb.movedim(-1, 0))
    lent = (shares * colors).sum(1) / shares.sum(0).clamp_min(torch.finfo(depth.dtype).tiny)
    color = torch.where(own, rgb.movedim(-1, 0).flatten(1), lent).mT.view_as(rgb)
    cameras, place = stack_cameras([camera]), BEHIND * farthest.view_as(depth)[None]
    base = PixelBase(
        rgb=color[None],
        distance=distance_from_depth(cameras, place),
        opacity=torch.full_like(place, OPAQUE),
        cameras=cameras,
    )
    fresh = place.new_zeros(sum(GAUSSIAN_SPLIT), *place.shape)
    cells = torch.arange(depth.numel(), device=depth.device)
    return BackgroundLayer(
        gaussians=activate(fresh, base, ActivationConfig(footprint_px=FOOTPRINT_PX)),
        cells=torch.where(own, cells, depth.numel()),
    )


def _behind(
    depth: Float[Tensor, "h w"],
) -> tuple[Float[Tensor, " n"], Float[Tensor, "k n"], Bool[Tensor, " n"]]:
    """Depth of the farthest near pixel, what each near one lends, and who is as far itself."""
    near = _around(depth[None])[0]
    farthest = near.amax(0)
    step = torch.arange(AROUND, device=depth.device, dtype=depth.dtype) - AROUND // 2
    away = (step.square()[:, None] + step.square()).flatten()[:, None]
    shares = torch.exp(-away / (2 * REACH_PX**2)) * ((farthest / near).log() < ONE_SURFACE)
    return farthest, shares, (farthest / depth.flatten()).log() < ONE_SURFACE


def _around(maps: Float[Tensor, "c h w"]) -> Float[Tensor, "c k n"]:
    """The pixels around each; those at the border are repeated outwards."""
    padded = torch.nn.functional.pad(maps[None], (AROUND // 2,) * 4, mode="replicate")
    return torch.nn.functional.unfold(padded, AROUND)[0].unflatten(0, (len(maps), -1))
