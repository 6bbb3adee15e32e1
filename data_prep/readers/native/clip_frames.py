"""Frames of a clip in memory, with depth and flow.

Axes: ``h w`` pixels. Frames are ordered by view, then by time.
"""

from collections.abc import Sequence

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.data.capture.capture import Flow, Frame
from diff4splat.data.clip import View
from diff4splat.data_prep.readers.files import pixel_layers
from diff4splat.data_prep.readers.files.pixel_layers import PixelLayers
from diff4splat.errors import InputError
from diff4splat.io.pixels import unit_rgb


class ClipFrames:
    """Frames of all views, downscaled by ``factor``."""

    def __init__(self, views: Sequence[View], factor: int) -> None:
        self._views, self._factor, self._times = tuple(views), factor, len(views[0].rgb)

    def __len__(self) -> int:
        return len(self._views) * self._times

    def read(self, index: int) -> Frame:
        """Read frame ``index``.

        Raises:
            InputError: there is no such frame.
        """
        if not 0 <= index < len(self):
            raise InputError(f"frame: expected 0 to {len(self) - 1}, got {index}")
        number, time = divmod(index, self._times)
        view = self._views[number]
        depth = None if view.depth is None else view.depth[time].float()
        known = PixelLayers(
            rgb=unit_rgb(view.rgb[time]).numpy(),
            depth=depth.numpy() if depth is not None and bool((depth > 0).any()) else None,
        )
        frame = pixel_layers.to_frame(pixel_layers.downscale(known, self._factor))
        flow = self._flow(view, time, index)
        return frame if flow is None else Frame(rgb=frame.rgb, depth=frame.depth, flow=flow)

    def _flow(self, view: View, time: int, index: int) -> Flow | None:
        if view.flow is None or time >= len(view.flow.to_next):
            return None
        known = view.flow.known[time].numpy()
        blocks = pixel_layers.pixel_blocks(known, self._factor).all(2)
        return Flow(
            to_frame=index + 1,
            offset_px=self._mean_offset(view.flow.to_next[time]),
            known=torch.from_numpy(blocks),
        )

    def _mean_offset(self, offset_px: Float[Tensor, "h w 2"]) -> Float[Tensor, "p q 2"]:
        """Mean flow per block, in pixels of the downscaled image."""
        mean = pixel_layers.pixel_blocks(offset_px.float().numpy(), self._factor).mean(
            2, dtype=np.float32
        )
        return torch.from_numpy(mean / np.float32(self._factor))
