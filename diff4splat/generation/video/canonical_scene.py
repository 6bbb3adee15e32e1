"""LDRM's raw maps to canonical Gaussians.

Axes: ``f h w`` frames, rows and columns of the Gaussian grid, ``n`` = f h w cells in that order,
``m`` of them kept. Without refinement every video frame has cells, based on the image's plane.
With refinement the key frames have, each based on its own colours on a plane in front of its own
camera (input-frame colour skip; the paper takes colours from tokens alone).
"""

from dataclasses import dataclass, replace

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from diff4splat.errors import ConfigError
from diff4splat.generation.layered_image.border.extension import border_extension
from diff4splat.generation.layered_image.gaussians import layer_gaussians
from diff4splat.generation.layered_image.visibility import visible_in_earlier_frame
from diff4splat.generation.video.keyframe_borders import keyframe_borders
from diff4splat.geometry.camera import Camera, stack_cameras
from diff4splat.geometry.depth import distance_from_depth
from diff4splat.models.blocks.conv_block import CELL_PX
from diff4splat.models.config.networks import ActivationConfig
from diff4splat.models.ldrm.gaussian_head import PixelBase, activate
from diff4splat.models.ldrm.plane_prior import OPAQUE, PLANE_DEPTH
from diff4splat.models.ldrm.raw_maps import RawGaussianMaps
from diff4splat.models.ldrm.refinement.motion_features import key_depth
from diff4splat.models.ldrm.refinement.posed_video import PosedVideo
from diff4splat.progress.run_log import RunLog
from diff4splat.scene.gaussians import Gaussians, concatenate

RENDER_CUTOFF = 1 / 255
"""Renderers draw nothing below this opacity, so dropping it changes no pixel."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CanonicalScene:
    """Gaussians at rest, with what their deformation needs."""

    gaussians: Gaussians
    cell_index: Int[Tensor, " m"]
    """Cell of each of the first m Gaussians; those of borders have none and are static."""
    maps: RawGaussianMaps


def reconstruct(
    maps: RawGaussianMaps,
    base: PixelBase,
    config: ActivationConfig,
    keep: Bool[Tensor, "f h w"] | None = None,
) -> CanonicalScene:
    """One Gaussian for every cell of a batch of one, or for those in the mask ``keep``."""
    gaussians = activate(maps.gaussians[0].float(), base, config)
    index = torch.arange(len(gaussians), device=gaussians.means.device)
    if keep is not None:
        index = keep.flatten().nonzero()[:, 0]
        gaussians = gaussians.select(index)
    return CanonicalScene(gaussians=gaussians, cell_index=index, maps=maps)


def reconstruct_refined(
    maps: RawGaussianMaps, video: PosedVideo, config: ActivationConfig, log: RunLog
) -> CanonicalScene:
    """Key frames and borders of a whole video; pixels that earlier key frames show are left out."""
    cameras, raw = video.key_cameras[0], maps.gaussians[0].float()
    base = keyframe_plane_prior(video.key_rgb[0].movedim(1, -1), cameras)
    depth = key_depth(raw[-1], config)
    keep = ~visible_in_earlier_frame(depth.detach(), cameras)
    if duplicates := int((~keep).sum()):
        why, saved = "an earlier key frame shows the same points", f"{duplicates:,} Gaussians"
        log.record_skipped("duplicate pixels", why, saved)
    scene = reconstruct(maps, base, config, keep)
    if maps.border is None:
        return scene
    border = border_gaussians(maps.border[0].float(), base, depth[0], config)
    fine = [layer_gaussians(one) for one in keyframe_borders(base.rgb, depth.detach(), cameras)]
    return replace(scene, gaussians=concatenate([scene.gaussians, border, *fine]))


def keyframe_plane_prior(rgb: Float[Tensor, "k h w 3"], cameras: Camera) -> PixelBase:
    """The key frames' own pixels, each on a plane in front of its own camera."""
    plane = torch.full_like(rgb[..., 0], PLANE_DEPTH)
    return PixelBase(
        rgb=rgb,
        distance=distance_from_depth(cameras, plane),
        opacity=torch.full_like(plane, OPAQUE),
        cameras=cameras,
    )


def border_gaussians(
    raw: Float[Tensor, "12 hs ws"],
    base: PixelBase,
    depth: Float[Tensor, "h w"],
    config: ActivationConfig,
) -> Gaussians:
    """The border extension of the first frame, corrected by LDRM."""
    camera = base.cameras[0]
    margin = (raw.shape[-1] - camera.size_px[1] // CELL_PX) // 2
    layer = border_extension(base.rgb[0], depth, camera, margin)
    cameras = stack_cameras([layer.camera])
    own = PixelBase(
        rgb=layer.rgb[None],
        distance=distance_from_depth(cameras, layer.depth[None]),
        opacity=torch.full_like(layer.depth, layer.opacity)[None],
        cameras=cameras,
    )
    return activate(raw[:, None], own, config)


def prune_cells(
    scene: CanonicalScene, min_opacity: float, log: RunLog, *, may_be_empty: bool = False
) -> CanonicalScene:
    """Keep Gaussians of at least ``min_opacity`` (Diff4Splat: 0.005), and note what that dropped.

    Raises:
        ConfigError: no Gaussian is left, unless the result ``may_be_empty``.
    """
    opacities, cells = scene.gaussians.opacities, len(scene.cell_index)
    keep = opacities >= min_opacity
    dropped = int((~keep).sum())
    if dropped == len(keep) and dropped and not may_be_empty:
        raise ConfigError(
            f"--min-opacity: expected a value that leaves some Gaussians, got {min_opacity:g}; "
            "lower it"
        )
    if dropped:
        faintest = float(opacities[~keep].max())
        log.record_skipped(
            "faint Gaussians",
            f"opacity below {min_opacity:g}",
            f"{dropped:,} of {len(keep):,} Gaussians",
            faintest if faintest >= RENDER_CUTOFF else 0.0,
            "opacity",
        )
    return CanonicalScene(
        gaussians=scene.gaussians.select(keep),
        cell_index=scene.cell_index[keep[:cells]],
        maps=scene.maps,
    )
