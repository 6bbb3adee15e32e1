"""A clip on its way through the stages: pixels, record, and what one stage measures for the next.

Axes: ``t`` frames, ``h w`` pixels of the reduced images (longer side 320).
"""

from dataclasses import dataclass, field, replace

import cv2
import numpy as np
from jaxtyping import Bool, UInt8

from diff4splat.data.clip import Clip, View
from diff4splat.data_prep.alignment.opencv.dis_flow import FlowPair
from diff4splat.data_prep.curation.clip_record import ClipRecord
from diff4splat.data_prep.curation.hooks import NO_HOOKS, Hooks
from diff4splat.geometry.camera import Camera

REDUCED_SIDE_PX = 320


@dataclass(frozen=True, slots=True, kw_only=True)
class WorkingClip:
    """What a stage takes and returns."""

    clip: Clip
    record: ClipRecord
    images: UInt8[np.ndarray, "t h w 3"]
    """The input view, reduced."""
    flows: tuple[FlowPair, ...] = ()
    """Of each reduced image to the next; none before the motion stage."""
    moving: Bool[np.ndarray, "t h w"] | None = None
    """Estimated or given; None before the dynamic stage, and where it is not known."""
    hooks: Hooks = field(default=NO_HOOKS)

    @property
    def view(self) -> View:
        """The input view."""
        return self.clip.views[0]

    @property
    def size_px(self) -> tuple[int, int]:
        """(height, width) of the reduced images."""
        return self.images.shape[1:3]

    @property
    def cameras(self) -> Camera:
        """Cameras of the reduced images."""
        return self.view.cameras.resized(self.size_px)

    @property
    def scale(self) -> float:
        """Reduced over full size."""
        return self.size_px[1] / self.clip.size_px[1]

    def scored(self, **scores: float | int | None) -> "WorkingClip":
        """The same with more scores."""
        return replace(self, record=self.record.with_scores(**scores))


def working_clip(clip: Clip, record: ClipRecord, hooks: Hooks = NO_HOOKS) -> WorkingClip:
    """A clip before the first stage."""
    images = reduced_images(clip.views[0].rgb.numpy())
    return WorkingClip(clip=clip, record=record, images=images, hooks=hooks)


def reduced_images(rgb: UInt8[np.ndarray, "t h w 3"]) -> UInt8[np.ndarray, "t h2 w2 3"]:
    """Images whose longer side is at most 320 pixels."""
    height, width = rgb.shape[1:3]
    factor = min(1.0, REDUCED_SIDE_PX / max(height, width))
    if factor == 1:
        return rgb
    size = (max(1, round(width * factor)), max(1, round(height * factor)))
    return np.stack([cv2.resize(each, size, interpolation=cv2.INTER_AREA) for each in rgb])


def reduced_map(values: np.ndarray, size_px: tuple[int, int]) -> np.ndarray:
    """Maps or masks at the reduced size, never interpolated."""
    kind = values.dtype
    source = values.astype(np.uint8) if kind.kind == "b" else values
    frames = [cv2.resize(v, size_px[::-1], interpolation=cv2.INTER_NEAREST_EXACT) for v in source]
    return np.stack(frames).astype(kind)
