"""One clip as it is judged: at the protocol's size, in model units, starting at 0 s.

Axes: ``h w`` pixels. Lengths are scaled so that the median depth of the first input frame is where
models put the photograph's plane: one picture has no scale, so a wrong one is nobody's error. A
clip without depth keeps its own unit, and nothing that needs depth is judged on it.
"""

import hashlib
from dataclasses import dataclass, replace

from jaxtyping import Float
from torch import Tensor

from diff4splat.data.clip import Clip, View
from diff4splat.errors import InputError
from diff4splat.geometry.camera import Camera
from diff4splat.io.pixels import unit_rgb
from diff4splat.training.batches.resize import resized
from diff4splat.training.batches.scale import normalized
from diff4splat.training.evaluation.protocol import Judged, Pair, Protocol, Task


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """A clip, the frames that a system may see of it, and what is judged."""

    clip: Clip
    task: Task
    judged: Judged
    has_depth: bool
    """False: lengths are in the clip's own unit, and depth and tracks are not judged."""

    @property
    def input_view(self) -> View:
        """The camera whose pictures are given."""
        return self.clip.views[0]

    @property
    def input_frames(self) -> int:
        """How many of its pictures are given, from the first on."""
        return self.clip.frames if self.task == "reconstruction" else 1

    def input_rgb(self, frame: int) -> Float[Tensor, "h w 3"]:
        """A given picture in [0, 1]."""
        return unit_rgb(self.input_view.rgb[frame])

    def nearest_input(self, frame: int) -> int:
        """The given frame nearest in time."""
        return min(frame, self.input_frames - 1)

    def camera(self, pair: Pair) -> Camera:
        """What looks at a judged picture."""
        return self.clip.views[pair[0]].cameras[pair[1]]

    def time_s(self, frame: int) -> float:
        """Seconds since the first frame."""
        return float(self.clip.times_s[frame])

    def true_rgb(self, pair: Pair) -> Float[Tensor, "h w 3"]:
        """A judged picture in [0, 1]."""
        return unit_rgb(self.clip.views[pair[0]].rgb[pair[1]])

    def true_depth(self, pair: Pair) -> Float[Tensor, "h w"]:
        """Z of a judged picture; 0 where there is none."""
        return self.clip.views[pair[0]].depth[pair[1]].float()


def make_case(clip: Clip, protocol: Protocol, task: Task) -> Case:
    """The clip as ``protocol`` judges it.

    Raises:
        InputError: too few views, another number of frames, or another shape of picture.
    """
    if clip.frames != protocol.frames or len(clip.views) < protocol.views:
        raise InputError(
            f"clip {clip.note.identifier}: expected {protocol.frames} frames of at least "
            f"{protocol.views} views, got {clip.frames} of {len(clip.views)}; leave the clip out"
        )
    clip = resized(clip, protocol.size_px)
    clip = replace(clip, times_s=clip.times_s - clip.times_s[0])
    judged = protocol.judged(task)
    try:
        scaled = normalized(clip)
    except InputError:
        return Case(clip=clip, task=task, judged=judged, has_depth=False)
    return Case(clip=scaled, task=task, judged=judged, has_depth=True)


def clip_sha256(clip: Clip) -> str:
    """Sixteen hexadecimal digits of all pictures: which clip it was, bit by bit."""
    digest = hashlib.sha256()
    for view in clip.views:
        digest.update(view.rgb.contiguous().numpy().tobytes())
    return digest.hexdigest()[:16]
