"""Frames of a capture, decoded on demand."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from diff4splat.data.capture.capture import Frame
from diff4splat.data_prep.readers.common.intrinsics import Intrinsics, undistortion_map
from diff4splat.data_prep.readers.common.undecoded_capture import Shot
from diff4splat.data_prep.readers.files import pixel_layers
from diff4splat.data_prep.readers.files.depth_file import read_mask
from diff4splat.data_prep.readers.files.lru_cache import LruCache
from diff4splat.data_prep.readers.files.pixel_layers import PixelLayers
from diff4splat.errors import FileFormatError, InputError

_MAP_BYTES = 1 << 28
"""Cache for undistortion maps; a rig has one per camera."""


class CaptureFrames:
    """Frames in the order of ``shots``: composited, masked, undistorted and downscaled."""

    def __init__(
        self, shots: Sequence[Shot], background: pixel_layers.Color | None, shrink: int
    ) -> None:
        self._shots, self._background, self._shrink = tuple(shots), background, shrink
        self._maps = LruCache(_MAP_BYTES)

    def __len__(self) -> int:
        return len(self._shots)

    def read(self, index: int) -> Frame:
        """Decode frame ``index``.

        Raises:
            InputError: there is no such frame.
            FileFormatError: a file is missing, damaged, of another size, or says nothing.
        """
        if not 0 <= index < len(self):
            raise InputError(f"frame: expected 0 to {len(self) - 1}, got {index}")
        shot = self._shots[index]
        layers = self._layers(shot)
        if shot.lens.is_distorted:
            layers = pixel_layers.undistort(layers, *self._map(shot.lens))
        return pixel_layers.to_frame(pixel_layers.downscale(layers, self._shrink))

    def _layers(self, shot: Shot) -> PixelLayers:
        """All pixel layers at the stored resolution."""
        pixels = shot.image.read()
        size_px = pixels.rgb.shape[:2]
        require_size(shot.image.where, size_px, shot.lens.size_px)
        known = pixel_layers.composite_over(pixels, self._background)
        if shot.image.is_float and known.counts is not None and not known.counts.any():
            raise FileFormatError(
                f"{shot.image.where}: expected an image, got NaN everywhere; leave it out"
            )
        if shot.mask is not None:
            known = pixel_layers.apply_mask(known, read_mask(shot.mask, size_px))
        return known if shot.depth is None else replace(known, depth=shot.depth.read(size_px))

    def _map(self, lens: Intrinsics) -> tuple[np.ndarray, ...]:
        found = self._maps.get(lens)
        if found is None:
            found = undistortion_map(lens)
            self._maps.put(lens, found)
        return found


def require_size(where: str, got: tuple[int, ...], want: tuple[int, int]) -> None:
    """Require the common image size.

    Raises:
        FileFormatError: naming the file.
    """
    if got != want:
        raise FileFormatError(
            f"{where}: expected images of one size, {want[1]} x {want[0]}, got {got[1]} x "
            f"{got[0]}: images of different sizes; make them alike, or leave this one out"
        )
