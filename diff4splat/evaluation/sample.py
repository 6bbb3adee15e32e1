"""One clip as it is judged: at the protocol's size, in model units, starting at 0 s.

Axes: ``h w`` pixels. Lengths are scaled so that the median depth of the first input frame is where
models put the photograph's plane: one picture has no scale, so a wrong one is nobody's error. A
clip without depth keeps its own unit, and nothing that needs depth is judged on it. A case holds
the whole truth; what may be given away of a video is ``input_clip``.
"""

import hashlib
from dataclasses import dataclass, replace

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.data.clip import Clip, ClipMetadata, View
from diff4splat.errors import InputError
from diff4splat.evaluation.protocol import Judged, Pair, Protocol, Task
from diff4splat.geometry.camera import Camera, stack_cameras
from diff4splat.io.pixels import unit_rgb
from diff4splat.training.batches.normalise_scale import normalized
from diff4splat.training.batches.resize import resized


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """A clip, the frames that a system may see of it, and what is judged."""

    clip: Clip
    task: Task
    judged: Judged
    input_frames: tuple[int, ...]
    """Which pictures of the input view are given, in order; the first one always is."""
    has_depth: bool
    """False: lengths are in the clip's own unit, and depth and tracks are not judged."""

    @property
    def input_view(self) -> View:
        """The camera whose pictures are given."""
        return self.clip.views[0]

    @property
    def input_clip(self) -> Clip:
        """The given pictures with their cameras and times, and nothing that is judged.

        A clip of one view and as many frames as are given. Depth is 0 (no truth); instances, flow,
        tracks and the notes on objects and stillness are left out.
        """
        view, note, frames = self.input_view, self.clip.note, list(self.input_frames)
        shown = View(
            rgb=view.rgb[frames],
            depth=torch.zeros_like(view.depth[frames]),
            cameras=stack_cameras([view.cameras[frame] for frame in frames]),
        )
        told = ClipMetadata(
            identifier=note.identifier,
            source=note.source,
            license=note.license,
            caption=note.caption,
        )
        return Clip(note=told, times_s=self.clip.times_s[frames], views=(shown,))

    def input_rgb(self, frame: int) -> Float[Tensor, "h w 3"]:
        """A given picture in [0, 1]."""
        return unit_rgb(self.input_view.rgb[frame])

    def nearest_input(self, frame: int) -> int:
        """The given frame nearest in time; the earlier of two that are equally near."""
        times_s, here_s = self.clip.times_s, self.time_s(frame)

        # In whole microseconds: rounding errors must not decide ties.
        def away_us(given: int) -> int:
            return round(abs(float(times_s[given]) - here_s) * 1e6)

        return min(self.input_frames, key=away_us)

    def input_around(self, frame: int) -> tuple[int, ...]:
        """The last given frame up to ``frame`` and the first from it on: one, or two."""
        before = [given for given in self.input_frames if given <= frame]
        after = [given for given in self.input_frames if given >= frame]
        return tuple(sorted({*before[-1:], *after[:1]}))

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
    case = Case(
        clip=clip,
        task=task,
        judged=protocol.judged(task),
        input_frames=protocol.input_frames(task),
        has_depth=False,
    )
    try:
        return replace(case, clip=normalized(clip), has_depth=True)
    except InputError:
        return case


def clip_sha256(clip: Clip) -> str:
    """Sixteen hexadecimal digits of all pictures: which clip it was, bit by bit."""
    digest = hashlib.sha256()
    for view in clip.views:
        digest.update(view.rgb.contiguous().numpy().tobytes())
    return digest.hexdigest()[:16]
