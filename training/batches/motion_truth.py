"""Where what the first frame shows really goes to, per cell: what a video model learns to tell.

Axes: ``n`` tracked points, ``t`` latent frames, ``h w`` pixels, ``hc wc`` cells of 4 pixels. A
pixel goes where the nearest followed point of its own object goes; a cell is the mean of its
pixels.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.data.clip import Clip, Tracks, View
from diff4splat.models.config_parts import MOTION_CELL_PX, TIME_STRIDE
from diff4splat.models.video_motion import UNIT
from diff4splat.training.batches.targets import INPUT_VIEW, LEAST_MOTION


def motion_truth(clip: Clip, input_stride: int) -> Float[Tensor, "3 t hc wc"]:
    """The motion of a clip in model units whose first camera is the identity.

    ``input_stride`` is the number of clip frames per frame of the video. A clip without masks or
    tracks counts as standing still.
    """
    view = clip.views[INPUT_VIEW]
    field = torch.zeros(3, _latent_frames(clip, input_stride), *clip.size_px)
    if clip.tracks is not None and view.instances is not None and view.track_uv is not None:
        _fill(field, view, clip.tracks, TIME_STRIDE * input_stride)
    depth = view.depth[0].float()
    relative = torch.where(depth > 0, field / depth.clamp_min(1e-6), 0.0)
    cells = torch.nn.functional.avg_pool2d(relative.transpose(0, 1), MOTION_CELL_PX)
    return cells.transpose(0, 1) / UNIT


def _latent_frames(clip: Clip, input_stride: int) -> int:
    return 1 + (clip.frames - 1) // (TIME_STRIDE * input_stride)


def _fill(field: Float[Tensor, "3 t h w"], view: View, tracks: Tracks, stride: int) -> None:
    """Ways of the pixels of everything that moves, in place."""
    ways = (tracks.positions[::stride] - tracks.positions[:1]).float()
    moves = ways.norm(dim=-1).amax(0) > LEAST_MOTION
    for instance in tracks.instances[moves].unique():
        points = (tracks.instances == instance).nonzero()[:, 0]
        rows, columns = (view.instances[0] == instance).nonzero(as_tuple=True)
        pixels = torch.stack([columns, rows], -1).float() + 0.5
        nearest = torch.cdist(pixels, view.track_uv[0, points].float()).argmin(1)
        field[:, :, rows, columns] = ways[:, points[nearest]].movedim(-1, 0)
