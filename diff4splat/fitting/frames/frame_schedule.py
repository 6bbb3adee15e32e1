"""Which frames a step uses.

The choice depends on the seed and the step alone, so a resumed fit continues with the same frames.
"""

import torch

from diff4splat.data.capture.capture import Capture


class FrameSchedule:
    """Visits every time once per round, in a new random order; likewise the views of a time."""

    def __init__(self, capture: Capture, views_per_step: int, seed: int) -> None:
        self._views, self._seed = views_per_step, seed
        frames_at: dict[float, list[int]] = {}
        for index in capture.learnt.tolist():
            frames_at.setdefault(float(capture.times_s[index]), []).append(index)
        self.frames_at = frames_at
        self.times_s = sorted(frames_at)

    def frames(self, step: int) -> tuple[float, list[int]]:
        """Time and frame indices of a step."""
        epoch, position = divmod(step, len(self.times_s))
        order = torch.randperm(len(self.times_s), generator=self._generator(epoch, 0))
        time_s = self.times_s[int(order[position])]
        frames = self.frames_at[time_s]
        order = torch.randperm(len(frames), generator=self._generator(step, 1))
        return time_s, [frames[i] for i in order[: self._views].tolist()]

    def _generator(self, number: int, purpose: int) -> torch.Generator:
        return torch.Generator().manual_seed((self._seed * 2 + purpose) * 1_000_003 + number)
