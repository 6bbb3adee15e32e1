"""One clip as it is evaluated: at the size of the protocol, in model units, starting at 0 s.

Axes: ``h w`` pixels. Lengths are scaled so that the median depth of the first input frame equals
the depth of the models' image plane, because a single image has no absolute scale. A clip without
depth keeps its unit, and metrics that need depth skip it. A sample holds the full ground truth; the
input of a system is ``input_clip``.
"""

import hashlib
from dataclasses import dataclass, replace

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.data.clip import Clip, ClipMetadata, View
from diff4splat.errors import InputError
from diff4splat.evaluation.protocols.protocol import Pair, Protocol, Targets, Task
from diff4splat.geometry.camera import Camera, stack_cameras
from diff4splat.io.pixels import unit_rgb
from diff4splat.training.batches.normalise_scale import normalized
from diff4splat.training.batches.resize import resized


@dataclass(frozen=True, slots=True, kw_only=True)
class EvalSample:
    """A clip, its input frames and its targets."""

    clip: Clip
    task: Task
    targets: Targets
    input_frames: tuple[int, ...]
    """Input frames of the input view, in order; always with the first one."""
    has_depth: bool
    """If false, lengths are in the unit of the clip, and depth and tracks are not evaluated."""

    @property
    def input_view(self) -> View:
        """The view that provides the input."""
        return self.clip.views[0]

    @property
    def input_clip(self) -> Clip:
        """The input frames with cameras and times, without ground truth.

        A clip of one view. Depth is 0 (unknown); instances, flow, tracks and the notes on objects
        and static clips are removed.
        """
        view, note, frames = self.input_view, self.clip.note, list(self.input_frames)
        input_view = View(
            rgb=view.rgb[frames],
            depth=torch.zeros_like(view.depth[frames]),
            cameras=stack_cameras([view.cameras[frame] for frame in frames]),
        )
        metadata = ClipMetadata(
            identifier=note.identifier,
            source=note.source,
            license=note.license,
            caption=note.caption,
        )
        return Clip(note=metadata, times_s=self.clip.times_s[frames], views=(input_view,))

    def input_rgb(self, frame: int) -> Float[Tensor, "h w 3"]:
        """An input image in [0, 1]."""
        return unit_rgb(self.input_view.rgb[frame])

    def nearest_input(self, frame: int) -> int:
        """The input frame nearest in time; the earlier of two at the same distance."""
        times_s, target_s = self.clip.times_s, self.time_s(frame)

        # Whole microseconds, so that rounding errors cannot decide ties.
        def distance_us(given: int) -> int:
            return round(abs(float(times_s[given]) - target_s) * 1e6)

        return min(self.input_frames, key=distance_us)

    def neighbouring_inputs(self, frame: int) -> tuple[int, ...]:
        """The last input frame up to ``frame`` and the first one from it on: one or two frames."""
        before = [given for given in self.input_frames if given <= frame]
        after = [given for given in self.input_frames if given >= frame]
        return tuple(sorted({*before[-1:], *after[:1]}))

    def camera(self, pair: Pair) -> Camera:
        """Camera of a target image."""
        return self.clip.views[pair[0]].cameras[pair[1]]

    def time_s(self, frame: int) -> float:
        """Seconds since the first frame."""
        return float(self.clip.times_s[frame])

    def true_rgb(self, pair: Pair) -> Float[Tensor, "h w 3"]:
        """A target image in [0, 1]."""
        return unit_rgb(self.clip.views[pair[0]].rgb[pair[1]])

    def true_depth(self, pair: Pair) -> Float[Tensor, "h w"]:
        """Z of a target image; 0 if unknown."""
        return self.clip.views[pair[0]].depth[pair[1]].float()


def make_sample(clip: Clip, protocol: Protocol, task: Task) -> EvalSample:
    """The clip as ``protocol`` evaluates it.

    Raises:
        InputError: no depth, too few views, a wrong number of frames, or another aspect ratio.
    """
    if any(view.depth is None for view in clip.views):
        raise InputError(
            f"clip {clip.note.identifier}: expected depth in every view, got a view without it; "
            "leave the clip out"
        )
    if clip.frames != protocol.frames or len(clip.views) < protocol.views:
        raise InputError(
            f"clip {clip.note.identifier}: expected {protocol.frames} frames of at least "
            f"{protocol.views} views, got {clip.frames} of {len(clip.views)}; leave the clip out"
        )
    clip = resized(clip, protocol.size_px)
    clip = replace(clip, times_s=clip.times_s - clip.times_s[0])
    sample = EvalSample(
        clip=clip,
        task=task,
        targets=protocol.targets(task),
        input_frames=protocol.input_frames(task),
        has_depth=False,
    )
    try:
        return replace(sample, clip=normalized(clip), has_depth=True)
    except InputError:
        return sample


def clip_sha256(clip: Clip) -> str:
    """Hash of all images of a clip, in sixteen hexadecimal digits."""
    digest = hashlib.sha256()
    for view in clip.views:
        digest.update(view.rgb.contiguous().numpy().tobytes())
    return digest.hexdigest()[:16]
