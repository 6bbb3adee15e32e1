"""Raw maps with their pictures to canonical Gaussians: key frames, backing, surroundings.

Axes: ``k`` key frames, ``h w`` pixels, ``n`` = k h w cells, ``m`` of them kept. Every key frame's
pixel starts with the colour that the decoded video has there (input-frame colour skip; a departure
from the paper, whose colours come from tokens alone), on a plane before its own camera. One picture
alone has a backing: nothing else shows what is seen between its pixels.
"""

from dataclasses import dataclass, replace

import torch
from jaxtyping import Float, Int
from torch import Tensor

from diff4splat.geometry.camera import Camera
from diff4splat.geometry.depth import distance_from_depth
from diff4splat.models.base_scene import OPAQUE, PLANE_DEPTH
from diff4splat.models.behind import behind_picture
from diff4splat.models.config_parts import ActivationConfig
from diff4splat.models.detail.backing import backing
from diff4splat.models.detail.coverage import covered
from diff4splat.models.detail.layers import CELL_PX
from diff4splat.models.detail.sight import Sight
from diff4splat.models.detail.stabilise import key_depth
from diff4splat.models.detail.surroundings import surroundings_base
from diff4splat.models.heads import PixelBase, activate
from diff4splat.models.maps import ReconstructionMaps
from diff4splat.scene.gaussians import Gaussians, concatenate

PIXEL_FOOTPRINT_PX = 0.25
"""Standard deviation of a Gaussian of one picture, as it is drawn: nothing is to be added."""
AROUND_CELLS = 0.6
"""The same of the coarse layer around one picture, in its own cells."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DetailedGaussians:
    """What ``canonical_gaussians`` makes."""

    gaussians: Gaussians
    """Those of pixels first, then their backing; the surroundings behind them never move."""
    cells: Int[Tensor, " m"]
    """Where each of the first m lies in the grid of key frames."""
    backing: Int[Tensor, " b"]
    """The cell with which each of the next b moves; the number after the last where it stands."""
    doubled: int
    """Pixels left out because an earlier key frame shows the same point."""


def canonical_gaussians(
    maps: ReconstructionMaps, sight: Sight, config: ActivationConfig
) -> DetailedGaussians:
    """Gaussians of a batch of one."""
    cameras, raw = sight.key_cameras[0], maps.gaussians[0].float()
    base = key_base(sight.key_rgb[0].movedim(1, -1), cameras)
    depth = key_depth(raw[-1], config)
    around = None
    if maps.surroundings is not None:
        told, looks = maps.surroundings[0].float(), config
        if len(depth) == 1:
            # Wide and faint as networks learn them, they would be fog before one sharp picture.
            told, looks = torch.zeros_like(told), replace(config, footprint_px=AROUND_CELLS)
        around = _surroundings(told, base, depth[0], looks)
    if len(depth) == 1:
        return _picture(raw, base, around, config)
    kept = ~covered(depth.detach(), cameras).flatten()
    pixels = activate(raw, base, config).select(kept)
    cells = kept.nonzero()[:, 0]
    return DetailedGaussians(
        gaussians=pixels if around is None else concatenate([pixels, around]),
        cells=cells,
        backing=cells[:0],
        doubled=len(kept) - len(cells),
    )


def _picture(
    raw: Float[Tensor, "12 1 h w"],
    base: PixelBase,
    around: Gaussians | None,
    config: ActivationConfig,
) -> DetailedGaussians:
    """One picture as it is on the depth that is told of it; what lies around it stays behind.

    Small, opaque and of its own colour, a pixel is sharp wherever it is seen from. Sizes and
    opacities that networks learn beside an uncertain depth make up for it by blur, which costs more
    than it saves once there is a backing (docs/adr/0023).
    """
    small = replace(config, footprint_px=PIXEL_FOOTPRINT_PX)
    plain = torch.cat([torch.zeros_like(raw[:-1]), raw[-1:]])
    depth = key_depth(raw[-1], config)[0]
    layer = backing(base.rgb[0], depth.detach(), base.cameras[0])
    parts = [activate(plain, base, small), layer.gaussians]
    if around is not None:
        parts.append(behind_picture(around, depth, base.cameras[0]))
    cells = torch.arange(depth.numel(), device=depth.device)
    return DetailedGaussians(
        gaussians=concatenate(parts), cells=cells, backing=layer.cells, doubled=0
    )


def key_base(rgb: Float[Tensor, "k h w 3"], cameras: Camera) -> PixelBase:
    """The key frames' own pixels, each on a plane before its own camera."""
    plane = torch.full_like(rgb[..., 0], PLANE_DEPTH)
    return PixelBase(
        rgb=rgb,
        distance=distance_from_depth(cameras, plane),
        opacity=torch.full_like(plane, OPAQUE),
        cameras=cameras,
    )


def _surroundings(
    raw: Float[Tensor, "12 hs ws"],
    base: PixelBase,
    depth: Float[Tensor, "h w"],
    config: ActivationConfig,
) -> Gaussians:
    """The layer behind the first picture."""
    camera = base.cameras[0]
    distance = distance_from_depth(camera, depth)
    margin = (raw.shape[-1] - base.rgb.shape[2] // CELL_PX) // 2
    behind = surroundings_base(base.rgb[0], distance, camera, margin)
    return activate(raw[:, None], behind, config)
