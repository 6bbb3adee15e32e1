"""What a held-out frame is new in: its view, its time, or nothing at all.

Names of splits cannot be trusted: the test frames of a widely used multi-view layout are images
that training has seen. So the kind is found from poses and times, frame by frame.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Float, Int
from torch import Tensor

from diff4splat.data.capture.capture import Capture
from diff4splat.errors import InputError

SAME_POSE = 1e-5
"""Poses closer than this are one view: in rotation entries, and in shares of the rig's extent."""
SAME_TIME = 1e-6
"""Times closer than this share of the time range are one time."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SplitReport:
    """How many frames are learnt from, and in what the held-out ones are new."""

    training: int
    new_views: int
    """Held-out frames from where no training frame was taken."""
    new_times: int
    """Held-out frames of a training view at a time that it was not seen at."""

    @property
    def held_out(self) -> int:
        """All held-out frames."""
        return self.new_views + self.new_times

    @property
    def kind(self) -> str:
        """In words."""
        if self.held_out == 0:
            return "nothing held out"
        if self.new_times == 0:
            return "new views"
        return "new times of training views" if self.new_views == 0 else "new views and new times"

    def __str__(self) -> str:
        if self.held_out == 0:
            return f"{self.training} frames to learn from, nothing held out"
        return f"{self.training} frames to learn from, {self.held_out} held out ({self.kind})"


def report_split(capture: Capture) -> SplitReport:
    """What the held-out frames of ``capture`` are new in.

    Raises:
        InputError: a held-out frame shows a view and a time that training sees too, or nothing is
            left to learn from.
    """
    held, learnt = capture.held_out, ~capture.held_out
    if not bool(learnt.any()):
        raise InputError(
            f"{capture.name}: expected frames to learn from, got {len(capture)} held-out ones only"
        )
    views = same_view_groups(capture.cameras.world_from_camera)
    moments = views * len(capture) + _same_time_groups(capture.times_s)
    repeated = torch.isin(moments[held], moments[learnt])
    if bool(repeated.any()):
        frame = int(held.nonzero()[repeated][0])
        raise InputError(
            f"{capture.name}: expected held-out frames that training does not see, got frame "
            f"{frame}, whose view and time are a training frame's ({int(repeated.sum())} such "
            "frames); hold out whole cameras instead"
        )
    seen_view = torch.isin(views[held], views[learnt])
    return SplitReport(
        training=int(learnt.sum()),
        new_views=int((~seen_view).sum()),
        new_times=int(seen_view.sum()),
    )


def same_view_groups(world_from_camera: Float[Tensor, "f 4 4"]) -> Int[Tensor, " f"]:
    """A number per frame; frames with the same number were taken from one view.

    Frames are grouped value by value, so that thousands need no table of all pairs. Poses that are
    joined by a chain of close ones count as one.
    """
    pose = world_from_camera.double()
    position = pose[:, :3, 3]
    extent = float((position - position.mean(0)).norm(dim=-1).max())
    values = torch.cat([pose[:, :3, :3].flatten(1), position / max(extent, 1e-12)], -1)
    groups = torch.stack([_close_values(column, SAME_POSE) for column in values.unbind(-1)], -1)
    return torch.unique(groups, dim=0, return_inverse=True)[1]


def _same_time_groups(times_s: Float[Tensor, " f"]) -> Int[Tensor, " f"]:
    times_s = times_s.double()
    span_s = float(times_s.max() - times_s.min())
    return _close_values(times_s / max(span_s, 1e-12), SAME_TIME)


def _close_values(values: Float[Tensor, " f"], gap: float) -> Int[Tensor, " f"]:
    """Numbers in the order of size; neighbours at most ``gap`` apart share one."""
    order = values.argsort()
    steps = values[order].diff(prepend=values[order[:1]]) > gap
    groups = torch.empty_like(order)
    groups[order] = steps.long().cumsum(0)
    return groups
