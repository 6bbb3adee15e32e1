"""``camera.npz``: lenses, poses and times of every view in double precision.

Axes: ``v`` views, ``t`` frames.
"""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float64
from torch import Tensor

from diff4splat.data.clip import Clip
from diff4splat.data.codecs.npz import encode_npz, opened_npz, take_array
from diff4splat.data.entry import ClipEntry
from diff4splat.geometry.camera import Camera


@dataclass(frozen=True, slots=True, kw_only=True)
class Cameras:
    """What the member holds."""

    times_s: Float64[Tensor, " t"]
    views: tuple[Camera, ...]


def encode_cameras(clip: Clip) -> bytes:
    """The member's bytes."""
    names = ("focal_px", "center_px", "world_from_camera")
    stacks = {
        name: np.stack([getattr(view.cameras, name).numpy() for view in clip.views])
        for name in names
    }
    return encode_npz({**stacks, "times_s": clip.times_s.numpy()})


def decode_cameras(content: bytes, entry: ClipEntry) -> Cameras:
    """The cameras of every view.

    Raises:
        FileFormatError: damaged, or of another size or type.
    """
    lead = (entry.views, entry.frames)
    with opened_npz(content) as archive:
        focal_px, center_px, poses = (
            torch.from_numpy(take_array(archive, name, np.float64, (*lead, *shape)))
            for name, shape in (
                ("focal_px", (2,)),
                ("center_px", (2,)),
                ("world_from_camera", (4, 4)),
            )
        )
        times_s = torch.from_numpy(take_array(archive, "times_s", np.float64, (entry.frames,)))
    views = tuple(
        Camera(
            focal_px=focal_px[view],
            center_px=center_px[view],
            world_from_camera=poses[view],
            size_px=entry.size_px,
        )
        for view in range(entry.views)
    )
    return Cameras(times_s=times_s, views=views)
