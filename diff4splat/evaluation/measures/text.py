"""Effect of the text on the motion.

Each sample has one image, one seed and three captions: the named object moves to the left, to the
right, and nothing moves. The scene flow of the object from the first to the last time, averaged
over its pixels in the first image, must point to the requested side of the input camera. A system
that ignores the text moves the object to the same side both times: half are correct, never both.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, runtime_checkable
from typing import Protocol as Interface

from jaxtyping import Bool
from torch import Tensor

from diff4splat.data.clip import Clip, ObjectNote
from diff4splat.evaluation.measures.images import Entries
from diff4splat.evaluation.measures.objects import (
    image_displacement,
    mask_iou,
    moves_most,
    object_masks,
    torn_flags,
)
from diff4splat.evaluation.measures.scenes import moving_share
from diff4splat.evaluation.protocols.protocol import Protocol
from diff4splat.evaluation.protocols.sample import EvalSample
from diff4splat.evaluation.records import Score, Skip
from diff4splat.evaluation.systems.predictions import scene_flow
from diff4splat.scene.scene import Scene

RequestedMotion = Literal["left", "right", "still"]
Captioner = Callable[[Clip, ObjectNote, RequestedMotion], str]
"""Writes the caption of a clip with another motion of one object."""
KEYS = ("text_right", "text_both", "text_still")
OBJECT_KEYS = ("text_object", "object_iou", "object_torn")
"""Measured where the first image shows a named object, too."""


@runtime_checkable
class TextConditionedSystem(Interface):
    """A system with text input."""

    def generate(self, sample: EvalSample, prompt: str | None, seed: int) -> Scene:
        """Generate a scene from the first image of the sample and another caption."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class TextSample:
    """One object with a requested motion."""

    sample: EvalSample
    note: ObjectNote
    mask: Bool[Tensor, "h w"]
    """Pixels of the object in the first image."""


def plain_caption(clip: Clip, note: ObjectNote, motion: RequestedMotion) -> str:
    """A short sentence that depends on the object only."""
    del clip
    named_object = " ".join(word for word in ("the", note.color, note.name) if word)
    return "nothing moves" if motion == "still" else f"{named_object} moves to the {motion}"


def text_sample(sample: EvalSample) -> TextSample | None:
    """The largest named object of the first image, moving ones first; None if there is none."""
    large = object_masks(sample)
    if not large:
        return None
    note, mask = max(large, key=lambda pair: (pair[0].motion != "", int(pair[1].sum())))
    return TextSample(sample=sample, note=note, mask=mask)


def text_entries(
    row: str,
    sample: EvalSample,
    system: TextConditionedSystem,
    captioner: Captioner,
    protocol: Protocol,
) -> Entries:
    """Correct directions, and the fraction of static Gaussians, of one sample."""
    target = text_sample(sample)
    if target is None:
        return [Skip(row=row, key=key, why="the first image shows no named object") for key in KEYS]
    scenes = {
        motion: system.generate(sample, captioner(sample.clip, target.note, motion), protocol.seed)
        for motion in ("left", "right", "still")
    }
    left = mean_rightward_flow(scenes["left"], target) < 0
    right = mean_rightward_flow(scenes["right"], target) > 0
    camera, times_s = sample.input_view.cameras[0], sample.clip.times_s
    still = 1 - moving_share(scenes["still"], camera, times_s, protocol.still_px)
    values = ((left + right) / 2, float(left and right), round(still, 6))
    scores: Entries = [
        Score(row=row, key=key, value=v) for key, v in zip(KEYS, values, strict=True)
    ]
    moved = [scenes["left"], scenes["right"]]
    return scores + _object_entries(row, target, moved, protocol.still_px)


def _object_entries(row: str, target: TextSample, scenes: list[Scene], still_px: float) -> Entries:
    """Whether the named object moves, alone and whole, in both scenes that ask it to."""
    named = object_masks(target.sample)
    masks, index = [mask for _, mask in named], [note for note, _ in named].index(target.note)
    displacements = [image_displacement(scene, target.sample) for scene in scenes]
    entries: Entries = []
    if len(masks) < 2:
        entries.append(Skip(row=row, key="text_object", why="the image shows one named object"))
    else:
        right = [moves_most(one, masks, index, still_px) for one in displacements]
        entries.append(Score(row=row, key="text_object", value=sum(right) / 2))
    overlaps = [mask_iou(one.norm(dim=-1) > still_px, target.mask) for one in displacements]
    entries.append(Score(row=row, key="object_iou", value=round(sum(overlaps) / 2, 6)))
    torn = [flag for one in displacements for flag in torn_flags(one, [target.mask], still_px)]
    if not torn:
        return [*entries, Skip(row=row, key="object_torn", why="the named object does not move")]
    return [*entries, Score(row=row, key="object_torn", value=sum(torn) / len(torn))]


def mean_rightward_flow(scene: Scene, target: TextSample) -> float:
    """Mean scene flow of the object along the x axis of the first input camera (and the world)."""
    camera, last_s = target.sample.input_view.cameras[0], float(target.sample.clip.times_s[-1])
    flow = scene_flow(scene, camera, 0.0, (last_s,))[0]
    return float(flow[..., 0][target.mask].mean())


def zero_motion_entries(row: str, sample: EvalSample) -> Entries:
    """Scores of a static scene: no direction is correct, all Gaussians are static."""
    if text_sample(sample) is None:
        return []
    return [Score(row=row, key=key, value=v) for key, v in zip(KEYS, (0.0, 0.0, 1.0), strict=True)]
