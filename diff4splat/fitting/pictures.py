"""Frames of a capture, kept in memory as far as allowed, and which of them a step looks at.

Which ones is a function of the seed and the step alone, so that a fit that was stopped goes on with
the frames it would have seen.
"""

from collections import OrderedDict

import torch

from diff4splat.data.capture.capture import Capture, Frame

MEMORY_BYTES = 1 << 30


class FrameStore:
    """Reads each frame once where memory allows; otherwise drops what was used longest ago."""

    def __init__(self, capture: Capture, memory_bytes: int = MEMORY_BYTES) -> None:
        self._capture, self._room = capture, memory_bytes
        self._kept: OrderedDict[int, tuple[Frame, int]] = OrderedDict()

    def read(self, index: int) -> Frame:
        """The frame, from memory or from its file."""
        if index in self._kept:
            self._kept.move_to_end(index)
            return self._kept[index][0]
        frame = self._capture.frames.read(index)
        size = _bytes(frame)
        self._kept[index], self._room = (frame, size), self._room - size
        while self._room < 0 and len(self._kept) > 1:
            _, (_, freed) = self._kept.popitem(last=False)
            self._room += freed
        return frame


class Schedule:
    """Every time comes once per round, in another order each round; views of it likewise."""

    def __init__(self, capture: Capture, views_per_step: int, seed: int) -> None:
        self._views, self._seed = views_per_step, seed
        at: dict[float, list[int]] = {}
        for index in capture.learnt.tolist():
            at.setdefault(float(capture.times_s[index]), []).append(index)
        self.frames_at = at
        self.times_s = sorted(at)

    def frames(self, step: int) -> tuple[float, list[int]]:
        """Time and frames of a step."""
        turn, place = divmod(step, len(self.times_s))
        order = torch.randperm(len(self.times_s), generator=self._generator(turn, 0))
        time_s = self.times_s[int(order[place])]
        frames = self.frames_at[time_s]
        drawn = torch.randperm(len(frames), generator=self._generator(step, 1))
        return time_s, [frames[i] for i in drawn[: self._views].tolist()]

    def _generator(self, number: int, purpose: int) -> torch.Generator:
        return torch.Generator().manual_seed((self._seed * 2 + purpose) * 1_000_003 + number)


def _bytes(frame: Frame) -> int:
    tensors = [frame.rgb, frame.counts, frame.depth]
    if frame.flow is not None:
        tensors += [frame.flow.offset_px, frame.flow.known]
    return sum(tensor.nbytes for tensor in tensors if tensor is not None)
