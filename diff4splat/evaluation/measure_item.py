"""Measure one item: the system, all baselines, and variants of the system."""

from dataclasses import dataclass, replace

import torch

from diff4splat.data.clip import Clip
from diff4splat.errors import ConfigError
from diff4splat.evaluation.columns import SYSTEM, TRUTH
from diff4splat.evaluation.measure_rows import (
    baseline_entries,
    fill_entries,
    prediction_entries,
    prepare_item,
    variant_entries,
)
from diff4splat.evaluation.measures.camera_poses import pose_entries
from diff4splat.evaluation.measures.diversity import diversity_entries
from diff4splat.evaluation.measures.images import Entries, true_images
from diff4splat.evaluation.measures.requests import request_entries
from diff4splat.evaluation.measures.scenes import check_path, scene_entries
from diff4splat.evaluation.measures.text import (
    Captioner,
    TextConditionedSystem,
    plain_caption,
    text_entries,
    text_sample,
    zero_motion_entries,
)
from diff4splat.evaluation.measures.videos import VideoNetworks, video_entries
from diff4splat.evaluation.protocols.protocol import Protocol, Task
from diff4splat.evaluation.protocols.sample import EvalSample, clip_sha256, make_sample
from diff4splat.evaluation.records import Embedding, ItemResult, Score, Skip
from diff4splat.evaluation.systems.baselines import ZERO_MOTION
from diff4splat.evaluation.systems.evaluated_system import EvaluatedSystem, Generator
from diff4splat.evaluation.systems.predictions import ScenePrediction
from diff4splat.evaluation.systems.variants import Variant
from diff4splat.metrics.features.protocol import PerceptualFeatures

NO_NETWORKS = VideoNetworks()


@dataclass(frozen=True, slots=True, kw_only=True)
class Setup:
    """One evaluation: system, protocol, task and perceptual features."""

    protocol: Protocol
    task: Task
    system: EvaluatedSystem
    features: PerceptualFeatures | None = None
    """None skips the perceptual column."""
    videos: VideoNetworks = NO_NETWORKS
    """What the target images are measured with as a video."""
    captioner: Captioner = plain_caption
    """Writes captions for the text task; its name is part of the run key."""
    variants: tuple[Variant, ...] = ()
    """The system with one thing changed: a row each, compared with the full system."""
    seeds: int = 1
    """Scenes per item whose spread is measured; 1 measures none."""

    def __post_init__(self) -> None:
        if self.task == "text" and not hasattr(self.system, "generate"):
            raise ConfigError(
                "--task text: expected a system that reads captions, got one that does not; "
                "choose another task"
            )


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
        embeddings=tuple(entry for entry in entries if isinstance(entry, Embedding)),
    )


def _measure_text(sample: EvalSample, setup: Setup) -> Entries:
    entries = _text_row(SYSTEM, sample, setup.system, setup)
    for variant in setup.variants:
        if variant.same:
            entries += [replace(e, row=variant.row) for e in entries if e.row == SYSTEM]
            continue
        entries += _text_row(variant.row, sample, variant.system, setup)
    return entries + zero_motion_entries(ZERO_MOTION, sample)


def _text_row(row: str, sample: EvalSample, system: TextConditionedSystem, setup: Setup) -> Entries:
    entries = text_entries(row, sample, system, setup.captioner, setup.protocol)
    target = text_sample(sample)
    if target is None:
        return entries
    return entries + request_entries(row, target, system, setup.protocol)


def _measure_images(sample: EvalSample, setup: Setup) -> Entries:
    scene = setup.system.predict(sample, setup.protocol.seed)
    item = prepare_item(sample, setup.protocol, setup.features, setup.videos)
    truth = video_entries(TRUTH, sample, true_images(sample), setup.videos)
    full = prediction_entries(SYSTEM, item, ScenePrediction(scene))
    entries = truth + full + scene_entries(SYSTEM, sample, scene, setup.protocol)
    entries += pose_entries(SYSTEM, scene, check_path(setup.protocol.pose, sample))
    later = range(setup.protocol.seed + 1, setup.protocol.seed + setup.seeds)
    scenes = [scene, *(setup.system.predict(sample, seed) for seed in later)]
    entries += diversity_entries(SYSTEM, sample, scenes, item.regions)
    entries += baseline_entries(item)
    if isinstance(setup.system, Generator):
        entries += fill_entries(setup.system, item, full)
    for variant in setup.variants:
        entries += variant_entries(variant, item, full)
    return entries
