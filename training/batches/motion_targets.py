"""Where what the first frame shows really goes to: what a video model learns to tell.

Axes: ``n`` tracked points, ``t`` latent frames, ``h w`` pixels, ``hc wc`` cells of 4 pixels. A
pixel goes where the nearest followed point of its own object goes; a cell is the mean of its
pixels. For a motion branch, which also tells what moves pixel by pixel, cells are continued: as
their own moving pixels go, and where there are none, as the nearest ones do.
"""

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.data.clip import Clip, Tracks, View
from diff4splat.models.config.networks import MOTION_CELL_PX, TIME_STRIDE
from diff4splat.models.ldrm.plane_prior import PLANE_DEPTH
from diff4splat.models.motion_unet.motion_field import UNIT
from diff4splat.training.batches.targets import INPUT_VIEW, MIN_MOTION


def motion_targets(clip: Clip, input_stride: int) -> Float[Tensor, "3 t hc wc"]:
    """The motion of a clip in model units whose first camera is the identity.

    ``input_stride`` is the number of clip frames per frame of the video. A clip without masks or
    tracks counts as standing still.
    """
    return cell_means(pixel_motion(clip, input_stride))


def pixel_motion(clip: Clip, input_stride: int) -> Float[Tensor, "3 t h w"]:
    """The same for every pixel, in the same units."""
    view = clip.views[INPUT_VIEW]
    field = torch.zeros(3, _latent_frames(clip, input_stride), *clip.size_px)
    if clip.tracks is not None and view.instances is not None and view.track_uv is not None:
        _fill(field, view, clip.tracks, TIME_STRIDE * input_stride)
    depth = view.depth[0].float()
    return torch.where(depth > 0, field / depth.clamp_min(1e-6), 0.0) / UNIT


def moving_mask(motion: Float[Tensor, "3 t h w"]) -> Bool[Tensor, "h w"]:
    """Which pixels ever leave their place by as much as counts."""
    return motion.norm(dim=0).amax(0) > MIN_MOTION / PLANE_DEPTH / UNIT


def extend_to_all_cells(
    motion: Float[Tensor, "3 t h w"], moving: Bool[Tensor, "h w"]
) -> Float[Tensor, "3 t hc wc"]:
    """How what moves in a cell goes; a cell in which nothing does goes as the nearest other.

    0 where nothing moves at all.
    """
    share = torch.nn.functional.avg_pool2d(moving.float()[None], MOTION_CELL_PX)[0]
    cells = cell_means(motion * moving) / share.clamp_min(0.5 / MOTION_CELL_PX**2)
    filled = share.nonzero()
    if len(filled) == 0:
        return cells
    every = torch.ones_like(share).nonzero()
    nearest = filled[torch.cdist(every.float(), filled.float()).argmin(1)]
    return cells[:, :, nearest[:, 0], nearest[:, 1]].unflatten(2, tuple(share.shape))


def cell_means(motion: Float[Tensor, "3 t h w"]) -> Float[Tensor, "3 t hc wc"]:
    """Of pixels."""
    return torch.nn.functional.avg_pool2d(motion, MOTION_CELL_PX)


def _latent_frames(clip: Clip, input_stride: int) -> int:
    return 1 + (clip.frames - 1) // (TIME_STRIDE * input_stride)


def _fill(field: Float[Tensor, "3 t h w"], view: View, tracks: Tracks, stride: int) -> None:
    """Ways of the pixels of everything that moves, in place."""
    ways = (tracks.positions[::stride] - tracks.positions[:1]).float()
    moves = ways.norm(dim=-1).amax(0) > MIN_MOTION
    for instance in tracks.instances[moves].unique():
        points = (tracks.instances == instance).nonzero()[:, 0]
        rows, columns = (view.instances[0] == instance).nonzero(as_tuple=True)
        pixels = torch.stack([columns, rows], -1).float() + 0.5
        nearest = torch.cdist(pixels, view.track_uv[0, points].float()).argmin(1)
        field[:, :, rows, columns] = ways[:, points[nearest]].movedim(-1, 0)
