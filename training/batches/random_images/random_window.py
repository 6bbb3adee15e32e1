"""A random part of an image, mirrored half of the time.

Axes: ``h w`` pixels of the image, ``y x`` of the sample.
"""

from dataclasses import dataclass

import cv2
import numpy as np
import torch
from jaxtyping import UInt8
from torch import Tensor

WHOLE_SHARE, LEAST_PART = 0.5, 0.55
"""Share of images that are shown whole; least side of a part, as a share of the image's."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RandomWindow:
    """Which part, and its size as a sample."""

    part: tuple[slice, slice]
    mirror: bool
    size_px: tuple[int, int]

    def colors(self, image: UInt8[Tensor, "h w 3"]) -> UInt8[Tensor, "y x 3"]:
        """Pixels of the part, averaged or interpolated."""
        shrinks = image[self.part].shape[0] > self.size_px[0]
        return self._resized(image, cv2.INTER_AREA if shrinks else cv2.INTER_CUBIC)

    def labels(self, numbers: UInt8[Tensor, "h w"]) -> UInt8[Tensor, "y x"]:
        """Numbers of the part, of the nearest pixel."""
        return self._resized(numbers, cv2.INTER_NEAREST)

    def _resized(self, image: Tensor, interpolation: int) -> Tensor:
        part = image[self.part].numpy()
        if self.mirror:
            part = np.ascontiguousarray(part[:, ::-1])
        return torch.from_numpy(cv2.resize(part, self.size_px[::-1], interpolation=interpolation))


def draw_window(
    image_px: tuple[int, int], size_px: tuple[int, int], generator: torch.Generator
) -> RandomWindow:
    """A part of an image of ``image_px`` as a sample of ``size_px``."""
    mirror, whole, share, top, left = torch.rand(5, generator=generator).tolist()
    share = 1.0 if whole < WHOLE_SHARE else LEAST_PART + (1 - LEAST_PART) * share
    height, width = (round(share * side) for side in image_px)
    top, left = round(top * (image_px[0] - height)), round(left * (image_px[1] - width))
    part = (slice(top, top + height), slice(left, left + width))
    return RandomWindow(part=part, mirror=mirror < 0.5, size_px=size_px)
