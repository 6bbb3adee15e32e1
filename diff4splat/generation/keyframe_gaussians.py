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

from diff4splat.generation.layered_image.background_layer import background_layer
from diff4splat.generation.layered_image.border_extension import border_extension
from diff4splat.generation.layered_image.occlusion_order import push_behind_surface
from diff4splat.generation.layered_image.visibility import visible_in_earlier_frame
from diff4splat.geometry.camera import Camera
from diff4splat.geometry.depth import distance_from_depth
from diff4splat.models.blocks.conv_block import CELL_PX
from diff4splat.models.config.networks import ActivationConfig
from diff4splat.models.ldrm.gaussian_head import PixelBase, activate
from diff4splat.models.ldrm.plane_prior import OPAQUE, PLANE_DEPTH
from diff4splat.models.ldrm.raw_maps import RawGaussianMaps
from diff4splat.models.ldrm.refinement.motion_features import key_depth
from diff4splat.models.ldrm.refinement.posed_video import PosedVideo
from diff4splat.scene.gaussians import Gaussians, concatenate

PIXEL_FOOTPRINT_PX = 0.25
"""Standard deviation of a Gaussian of one picture, as it is drawn: nothing is to be added."""
AROUND_CELLS = 0.6
"""The same of the coarse layer around one picture, in its own cells."""


@dataclass(frozen=True, slots=True, kw_only=True)
class KeyframeGaussians:
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
    maps: RawGaussianMaps, sight: PosedVideo, config: ActivationConfig
) -> KeyframeGaussians:
    """Gaussians of a batch of one."""
    cameras, raw = sight.key_cameras[0], maps.gaussians[0].float()
    base = keyframe_plane_prior(sight.key_rgb[0].movedim(1, -1), cameras)
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
    kept = ~visible_in_earlier_frame(depth.detach(), cameras).flatten()
    pixels = activate(raw, base, config).select(kept)
    cells = kept.nonzero()[:, 0]
    return KeyframeGaussians(
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
) -> KeyframeGaussians:
    """One picture as it is on the depth that is told of it; what lies around it stays behind.

    Small, opaque and of its own colour, a pixel is sharp wherever it is seen from. Sizes and
    opacities that networks learn beside an uncertain depth make up for it by blur, which costs more
    than it saves once there is a backing (docs/adr/0023).
    """
    small = replace(config, footprint_px=PIXEL_FOOTPRINT_PX)
    plain = torch.cat([torch.zeros_like(raw[:-1]), raw[-1:]])
    depth = key_depth(raw[-1], config)[0]
    layer = background_layer(base.rgb[0], depth.detach(), base.cameras[0])
    parts = [activate(plain, base, small), layer.gaussians]
    if around is not None:
        parts.append(push_behind_surface(around, depth, base.cameras[0]))
    cells = torch.arange(depth.numel(), device=depth.device)
    return KeyframeGaussians(
        gaussians=concatenate(parts), cells=cells, backing=layer.cells, doubled=0
    )


def keyframe_plane_prior(rgb: Float[Tensor, "k h w 3"], cameras: Camera) -> PixelBase:
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
    behind = border_extension(base.rgb[0], distance, camera, margin)
    return activate(raw[:, None], behind, config)
