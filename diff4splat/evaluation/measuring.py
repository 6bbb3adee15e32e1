"""Everything that is measured on one item: the system and all baselines, in one go."""

from dataclasses import dataclass

import torch
from jaxtyping import Bool
from torch import Tensor

from diff4splat.data.clip import Clip
from diff4splat.errors import ConfigError, InputError
from diff4splat.evaluation.baselines import BASELINES, ZERO_MOTION, make_baseline
from diff4splat.evaluation.camera_measures import pose_entries
from diff4splat.evaluation.columns import SYSTEM
from diff4splat.evaluation.covisibility import covisible
from diff4splat.evaluation.picture_measures import Entries, picture_entries
from diff4splat.evaluation.predictions import Answer, SceneAnswer
from diff4splat.evaluation.protocol import Protocol, Task
from diff4splat.evaluation.records import ItemResult, Score, Skip
from diff4splat.evaluation.sample import Case, clip_sha256, make_case
from diff4splat.evaluation.scene_measures import check_path, scene_entries
from diff4splat.evaluation.systems import Subject
from diff4splat.evaluation.text_measures import (
    Captioner,
    motionless_entries,
    plain_caption,
    text_entries,
)
from diff4splat.evaluation.track_measures import Followed, followed_points, track_entries
from diff4splat.metrics.features.protocol import PerceptualFeatures


@dataclass(frozen=True, slots=True, kw_only=True)
class Setup:
    """One evaluation: who is measured, how, and with which helpers."""

    protocol: Protocol
    task: Task
    subject: Subject
    features: PerceptualFeatures | None = None
    """None leaves the perceptual column out."""
    captioner: Captioner = plain_caption
    """A function; its name is part of what results belong to."""

    def __post_init__(self) -> None:
        if self.task == "text" and not hasattr(self.subject, "generate"):
            raise ConfigError(
                "--task text: expected a system that reads captions, got one that does not; "
                "choose another task"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Truth:
    """What all rows of an item are held against, computed once."""

    followed: list[Followed]
    seen: Bool[Tensor, "p h w"] | None
    """Which pixels of the judged pictures the input shows."""


@torch.no_grad()
def measure_item(item: int, clip: Clip, setup: Setup) -> ItemResult:
    """All rows of one item.

    Raises:
        Diff4SplatError: the clip does not fit the protocol, or the system does not take it.
    """
    case = make_case(clip, setup.protocol, setup.task)
    entries = _text(case, setup) if setup.task == "text" else _pictures(case, setup)
    return ItemResult(
        item=item,
        clip=clip.note.identifier,
        clip_sha256=clip_sha256(clip),
        scores=tuple(entry for entry in entries if isinstance(entry, Score)),
        skips=tuple(entry for entry in entries if isinstance(entry, Skip)),
    )


def _text(case: Case, setup: Setup) -> Entries:
    own = text_entries(SYSTEM, case, setup.subject, setup.captioner, setup.protocol)
    return own + motionless_entries(ZERO_MOTION, case)


def _pictures(case: Case, setup: Setup) -> Entries:
    scene = setup.subject.answer(case, setup.protocol.seed)
    truth = _Truth(followed=followed_points(case, setup.protocol), seen=covisible(case))
    entries = _answered(SYSTEM, case, SceneAnswer(scene), truth, setup)
    entries += scene_entries(SYSTEM, case, scene, setup.protocol)
    entries += pose_entries(SYSTEM, scene, check_path(setup.protocol.pose, case))
    for name in BASELINES:
        try:
            answer = make_baseline(name, case, setup.protocol.planes)
        except InputError as error:
            entries.append(Skip(row=name, key="psnr", why=str(error)))
            continue
        entries += _answered(name, case, answer, truth, setup)
    return entries


def _answered(row: str, case: Case, answer: Answer, truth: _Truth, setup: Setup) -> Entries:
    pictures = picture_entries(row, case, answer, truth.seen, setup.features)
    return pictures + track_entries(row, case, answer, truth.followed)
