"""The pictures of a capture, read when they are asked for."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from diff4splat.data.capture.capture import Frame
from diff4splat.data_prep.readers import layers
from diff4splat.data_prep.readers.depth_file import read_mask
from diff4splat.data_prep.readers.layers import Layers
from diff4splat.data_prep.readers.lens import Lens, source_pixels
from diff4splat.data_prep.readers.recent import Recent
from diff4splat.data_prep.readers.shots import Shot
from diff4splat.errors import FileFormatError, InputError

_MAP_BYTES = 1 << 28
"""For where straightened pixels come from; a rig has one such map per camera."""


class ShotFrames:
    """Frames by the order of ``shots``: composited, masked, straightened, made coarser."""

    def __init__(self, shots: Sequence[Shot], background: layers.Color | None, shrink: int) -> None:
        self._shots, self._background, self._shrink = tuple(shots), background, shrink
        self._maps = Recent(_MAP_BYTES)

    def __len__(self) -> int:
        return len(self._shots)

    def read(self, index: int) -> Frame:
        """The picture of frame ``index``.

        Raises:
            InputError: there is no such frame.
            FileFormatError: a file is missing, damaged, of another size, or says nothing.
        """
        if not 0 <= index < len(self):
            raise InputError(f"frame: expected 0 to {len(self) - 1}, got {index}")
        shot = self._shots[index]
        known = self._known(shot)
        if shot.lens.is_bent:
            known = layers.straightened(known, *self._map(shot.lens))
        return layers.to_frame(layers.coarser(known, self._shrink))

    def _known(self, shot: Shot) -> Layers:
        """Everything the files say, on the grid of the picture as stored."""
        pixels = shot.picture.read()
        size_px = pixels.rgb.shape[:2]
        require_size(shot.picture.where, size_px, shot.lens.size_px)
        known = layers.over_background(pixels, self._background)
        if shot.picture.is_float and known.counts is not None and not known.counts.any():
            raise FileFormatError(
                f"{shot.picture.where}: expected a picture, got NaN everywhere; leave it out"
            )
        if shot.mask is not None:
            known = layers.covered(known, read_mask(shot.mask, size_px))
        return known if shot.depth is None else replace(known, depth=shot.depth.read(size_px))

    def _map(self, lens: Lens) -> tuple[np.ndarray, ...]:
        found = self._maps.get(lens)
        if found is None:
            found = source_pixels(lens)
            self._maps.put(lens, found)
        return found


def require_size(where: str, got: tuple[int, ...], want: tuple[int, int]) -> None:
    """Refuse a picture of another size than the others.

    Raises:
        FileFormatError: naming the file.
    """
    if got != want:
        raise FileFormatError(
            f"{where}: expected pictures of one size, {want[1]} x {want[0]}, got {got[1]} x "
            f"{got[0]}: images of different sizes; make them alike, or leave this one out"
        )
