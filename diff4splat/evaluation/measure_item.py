"""Measure one item: the system and all baselines."""

from dataclasses import dataclass

import torch
from jaxtyping import Bool
from torch import Tensor

from diff4splat.data.clip import Clip
from diff4splat.errors import ConfigError, InputError
from diff4splat.evaluation.columns import SYSTEM
from diff4splat.evaluation.measures.camera_poses import pose_entries
from diff4splat.evaluation.measures.covisibility import covisible_masks
from diff4splat.evaluation.measures.images import Entries, image_entries
from diff4splat.evaluation.measures.scenes import check_path, scene_entries
from diff4splat.evaluation.measures.text import (
    Captioner,
    plain_caption,
    text_entries,
    zero_motion_entries,
)
from diff4splat.evaluation.measures.tracks import TrackedPoints, track_entries, tracked_points
from diff4splat.evaluation.protocols.protocol import Protocol, Task
from diff4splat.evaluation.protocols.sample import EvalSample, clip_sha256, make_sample
from diff4splat.evaluation.records import ItemResult, Score, Skip
from diff4splat.evaluation.systems.baselines import BASELINES, ZERO_MOTION, make_baseline
from diff4splat.evaluation.systems.evaluated_system import EvaluatedSystem
from diff4splat.evaluation.systems.predictions import Prediction, ScenePrediction
from diff4splat.metrics.features.protocol import PerceptualFeatures


@dataclass(frozen=True, slots=True, kw_only=True)
class Setup:
    """One evaluation: system, protocol, task and perceptual features."""

    protocol: Protocol
    task: Task
    system: EvaluatedSystem
    features: PerceptualFeatures | None = None
    """None skips the perceptual column."""
    captioner: Captioner = plain_caption
    """Writes captions for the text task; its name is part of the run key."""

    def __post_init__(self) -> None:
        if self.task == "text" and not hasattr(self.system, "generate"):
            raise ConfigError(
                "--task text: expected a system that reads captions, got one that does not; "
                "choose another task"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Truth:
    """Ground truth shared by all rows of an item."""

    tracked: list[TrackedPoints]
    covisible: Bool[Tensor, "p h w"] | None
    """Pixels of the target images that are visible in the input."""


@torch.no_grad()
def measure_item(item: int, clip: Clip, setup: Setup) -> ItemResult:
    """Measure all rows of one item.

    Raises:
        Diff4SplatError: the clip does not fit the protocol, or the system rejects it.
    """
    sample = make_sample(clip, setup.protocol, setup.task)
    measure = _measure_text if setup.task == "text" else _measure_images
    entries = measure(sample, setup)
    return ItemResult(
        item=item,
        clip=clip.note.identifier,
        clip_sha256=clip_sha256(clip),
        scores=tuple(entry for entry in entries if isinstance(entry, Score)),
        skips=tuple(entry for entry in entries if isinstance(entry, Skip)),
    )


def _measure_text(sample: EvalSample, setup: Setup) -> Entries:
    entries = text_entries(SYSTEM, sample, setup.system, setup.captioner, setup.protocol)
    return entries + zero_motion_entries(ZERO_MOTION, sample)


def _measure_images(sample: EvalSample, setup: Setup) -> Entries:
    scene = setup.system.predict(sample, setup.protocol.seed)
    truth = _Truth(
        tracked=tracked_points(sample, setup.protocol), covisible=covisible_masks(sample)
    )
    entries = _prediction_entries(SYSTEM, sample, ScenePrediction(scene), truth, setup)
    entries += scene_entries(SYSTEM, sample, scene, setup.protocol)
    entries += pose_entries(SYSTEM, scene, check_path(setup.protocol.pose, sample))
    for name in BASELINES:
        try:
            prediction = make_baseline(name, sample, setup.protocol.planes)
        except InputError as error:
            entries.append(Skip(row=name, key="psnr", why=str(error)))
            continue
        entries += _prediction_entries(name, sample, prediction, truth, setup)
    return entries


def _prediction_entries(
    row: str, sample: EvalSample, prediction: Prediction, truth: _Truth, setup: Setup
) -> Entries:
    images = image_entries(row, sample, prediction, truth.covisible, setup.features)
    return images + track_entries(row, sample, prediction, truth.tracked)
