"""An in-memory cache for frames of a capture."""

from collections import OrderedDict
from dataclasses import replace

import torch

from diff4splat.data.capture.capture import Capture, Frame

MEMORY_BYTES = 1 << 30


class FrameStore:
    """Reads frames and keeps the most recently used ones, up to ``memory_bytes``."""

    def __init__(
        self,
        capture: Capture,
        memory_bytes: int = MEMORY_BYTES,
        dtype: torch.dtype = torch.float32,
    ) -> None:
        """Colours and depth are read as ``dtype``."""
        self._capture, self._free_bytes, self._dtype = capture, memory_bytes, dtype
        self._cached: OrderedDict[int, tuple[Frame, int]] = OrderedDict()

    def read(self, index: int) -> Frame:
        """The frame, from memory or from its file."""
        if index in self._cached:
            self._cached.move_to_end(index)
            return self._cached[index][0]
        frame = _cast(self._capture.frames.read(index), self._dtype)
        size = _size_bytes(frame)
        self._cached[index], self._free_bytes = (frame, size), self._free_bytes - size
        while self._free_bytes < 0 and len(self._cached) > 1:
            _, (_, freed) = self._cached.popitem(last=False)
            self._free_bytes += freed
        return frame


def _cast(frame: Frame, dtype: torch.dtype) -> Frame:
    depth = None if frame.depth is None else frame.depth.to(dtype)
    return replace(frame, rgb=frame.rgb.to(dtype), depth=depth)


def _size_bytes(frame: Frame) -> int:
    tensors = [frame.rgb, frame.counts, frame.depth]
    if frame.flow is not None:
        tensors += [frame.flow.offset_px, frame.flow.known]
    return sum(tensor.nbytes for tensor in tensors if tensor is not None)
