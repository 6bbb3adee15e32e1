"""What a stage takes: samples of one shape, stacked.

Axes: ``b`` batch, ``f`` input frames, ``h w`` pixels, ``m`` target times, ``p`` target views per
time, ``n`` tracked points. Lengths are model units (see ``scale``); times are fractions of the clip
in [0, 1]. Pixels stay 8 bits wide until a stage needs them: worker processes pass them on.
"""

from dataclasses import dataclass, fields, replace

import torch
from jaxtyping import Bool, Float, Int, UInt8
from torch import Tensor

from diff4splat.geometry.camera import Camera, join_cameras
from diff4splat.models.ldrm.refinement.posed_video import camera_frames


@dataclass(frozen=True, slots=True, kw_only=True)
class ClipBatch:
    """The input video with its cameras, images to be rendered, and points that move."""

    sample_index: Int[Tensor, " b"]
    source: tuple[str, ...]
    """Which source of the mixture each sample comes from."""
    video: UInt8[Tensor, "b f h w 3"]
    cameras: Camera
    """Batch shape (b, f); the first of each sample is the identity."""
    depth: Float[Tensor, "b g h w"]
    """z of the input frames whose pixels carry Gaussians; 0 where there is none."""
    target_rgb: UInt8[Tensor, "b m p h w 3"]
    target_depth: Float[Tensor, "b m p h w"]
    """z; 0 where there is none."""
    target_cameras: Camera
    """Batch shape (b, m, p)."""
    target_time: Float[Tensor, "b m"]
    track_cell: Int[Tensor, "b n 3"]
    """(frame, row, column) of the input pixel that shows the point."""
    track_offset: Float[Tensor, "b m n 3"]
    """Where the point is at the target time, relative to where it is at its own frame's."""
    track_valid: Bool[Tensor, "b n"]
    field: Float[Tensor, "b 3 t hc wc"]
    """Relative displacement of every cell (``motion_field``), extended from those that move."""
    moving: Bool[Tensor, "b h w"]
    """Pixels of the first frame that move."""
    motion_known: Bool[Tensor, " b"]
    """Whether ``field`` and ``moving`` are the truth; otherwise they are 0 and teach nothing."""
    is_static: Bool[Tensor, " b"]
    captions: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.sample_index)

    def first_image(self) -> "ClipBatch":
        """The same with nothing but the first frame as input; targets stay."""
        first = camera_frames(self.cameras, torch.zeros(1, dtype=torch.long))
        return replace(self, video=self.video[:, :1], cameras=first, depth=self.depth[:, :1])

    def to(self, device: torch.device) -> "ClipBatch":
        """Move every tensor."""
        moved = {
            field.name: getattr(self, field.name).to(device)
            for field in fields(self)
            if field.name not in ("captions", "source")
        }
        return replace(self, **moved)


def collate(samples: list[ClipBatch]) -> ClipBatch:
    """Batches of one sample each, as one."""
    joined = {}
    for field in fields(ClipBatch):
        values = [getattr(sample, field.name) for sample in samples]
        if isinstance(values[0], Camera):
            joined[field.name] = join_cameras(values)
        elif isinstance(values[0], tuple):
            joined[field.name] = tuple(text for value in values for text in value)
        else:
            joined[field.name] = torch.cat(values)
    return ClipBatch(**joined)
