"""The true motion of what the first frame shows, as the motion network predicts it.

Axes: ``n`` tracked points, ``t`` latent frames, ``h w`` pixels, ``hc wc`` cells of 4 pixels. A
pixel has the displacement of the nearest tracked point of its object. A cell has the mean of its
moving pixels; a cell without any has the motion of the nearest cell with some.
"""

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.data.clip import Clip, Tracks, View
from diff4splat.models.config.networks import MOTION_CELL_PX, TIME_STRIDE
from diff4splat.models.ldrm.plane_prior import PLANE_DEPTH
from diff4splat.models.motion_unet.motion_field import UNIT
from diff4splat.training.batches.targets import INPUT_VIEW, MIN_MOTION


def pixel_motion(clip: Clip, input_stride: int) -> Float[Tensor, "3 t h w"]:
    """Relative displacement of every pixel of the first frame, in the unit of ``motion_field``.

    The clip is in model units and its first camera is the identity. ``input_stride`` is the number
    of clip frames per frame of the video. 0 where ``motion_known`` is False.
    """
    view = clip.views[INPUT_VIEW]
    field = torch.zeros(3, _latent_frames(clip, input_stride), *clip.size_px)
    if clip.motion_truth != "objects" or not motion_known(clip, input_stride):
        return field
    _fill(field, view, clip.tracks, TIME_STRIDE * input_stride)
    depth = view.depth[0].float()
    return torch.where(depth > 0, field / depth.clamp_min(1e-6), 0.0) / UNIT


def motion_known(clip: Clip, input_stride: int) -> bool:
    """Whether the clip tells the motion of every pixel: absent masks do not mean stillness.

    True for static clips, and with depth and masks of objects whose tracks have points that are
    known in all latent frames.
    """
    view, tracks = clip.views[INPUT_VIEW], clip.tracks
    if clip.motion_truth != "objects":
        return clip.motion_truth == "static"
    if view.depth is None:
        return False
    lasting = _lasting(tracks, TIME_STRIDE * input_stride)
    return set(tracks.instances.tolist()) == set(tracks.instances[lasting].tolist())


def _lasting(tracks: Tracks, stride: int) -> Bool[Tensor, " n"]:
    """Points that the source has in every latent frame."""
    if tracks.known is None:
        return torch.ones(tracks.positions.shape[1], dtype=torch.bool)
    return tracks.known[::stride].all(0)


def moving_mask(motion: Float[Tensor, "3 t h w"]) -> Bool[Tensor, "h w"]:
    """Pixels whose displacement ever exceeds the least that counts as motion."""
    return motion.norm(dim=0).amax(0) > MIN_MOTION / PLANE_DEPTH / UNIT


def extend_to_all_cells(
    motion: Float[Tensor, "3 t h w"], moving: Bool[Tensor, "h w"]
) -> Float[Tensor, "3 t hc wc"]:
    """Motion of the moving pixels of every cell, extended to cells without any from the nearest.

    0 in a clip in which nothing moves.
    """
    share = torch.nn.functional.avg_pool2d(moving.float()[None], MOTION_CELL_PX)[0]
    cells = cell_means(motion * moving) / share.clamp_min(0.5 / MOTION_CELL_PX**2)
    return extended_from(cells, share > 0)


def extended_from(
    cells: Float[Tensor, "3 t hc wc"], known: Bool[Tensor, "hc wc"]
) -> Float[Tensor, "3 t hc wc"]:
    """Every cell with the motion of the nearest ``known`` one; unchanged without any."""
    filled = known.nonzero()
    if len(filled) == 0:
        return cells
    every = torch.ones_like(known).nonzero()
    nearest = filled[torch.cdist(every.float(), filled.float()).argmin(1)]
    return cells[:, :, nearest[:, 0], nearest[:, 1]].unflatten(2, tuple(known.shape))


def cell_means(motion: Float[Tensor, "3 t h w"]) -> Float[Tensor, "3 t hc wc"]:
    """Means over the pixels of every cell."""
    return torch.nn.functional.avg_pool2d(motion, MOTION_CELL_PX)


def _latent_frames(clip: Clip, input_stride: int) -> int:
    return 1 + (clip.frames - 1) // (TIME_STRIDE * input_stride)


def _fill(field: Float[Tensor, "3 t h w"], view: View, tracks: Tracks, stride: int) -> None:
    """Write the displacement of every pixel of a moving object into ``field``."""
    displacement = (tracks.positions[::stride] - tracks.positions[:1]).float()
    lasting = _lasting(tracks, stride)
    moves = (displacement.norm(dim=-1).amax(0) > MIN_MOTION) & lasting
    for instance in tracks.instances[moves].unique():
        points = ((tracks.instances == instance) & lasting).nonzero()[:, 0]
        rows, columns = (view.instances[0] == instance).nonzero(as_tuple=True)
        pixels = torch.stack([columns, rows], -1).float() + 0.5
        nearest = torch.cdist(pixels, view.track_uv[0, points].float()).argmin(1)
        field[:, :, rows, columns] = displacement[:, points[nearest]].movedim(-1, 0)
