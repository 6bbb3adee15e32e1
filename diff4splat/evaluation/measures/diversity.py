"""Spread of the images of several seeds: what a generator leaves open, it should vary.

Axes: ``s`` seeds, ``p`` target images, ``h w`` pixels. The RMS difference of colours in [0, 1] of
two seeds, mean over all pairs of seeds; over all pixels, and over those that the input hides.
"""

import math
from collections.abc import Sequence
from itertools import combinations

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.evaluation.measures.images import Entries, stacked_rgb, target_views
from diff4splat.evaluation.measures.regions import MIN_PIXELS, TrueRegions
from diff4splat.evaluation.protocols.sample import EvalSample
from diff4splat.evaluation.records import Score, Skip
from diff4splat.evaluation.systems.predictions import ScenePrediction
from diff4splat.scene.scene import Scene

KEYS = ("diversity", "diversity_hidden")


def diversity_entries(
    row: str, sample: EvalSample, scenes: Sequence[Scene], regions: TrueRegions | None
) -> Entries:
    """Spread of scenes of several seeds; empty for fewer than two."""
    if len(scenes) < 2:
        return []
    rgb = torch.stack([stacked_rgb(target_views(sample, ScenePrediction(one))) for one in scenes])
    every = torch.ones(rgb.shape[1:-1], dtype=torch.bool)
    entries: Entries = [Score(row=row, key=KEYS[0], value=round(pairwise_rms(rgb, every), 6))]
    hidden = None if regions is None else regions.hidden.regions["hidden"]
    if hidden is None or int(hidden.sum()) < MIN_PIXELS:
        return [*entries, Skip(row=row, key=KEYS[1], why="the input hides no pixel")]
    return [*entries, Score(row=row, key=KEYS[1], value=round(pairwise_rms(rgb, hidden), 6))]


def pairwise_rms(rgb: Float[Tensor, "s p h w 3"], mask: Bool[Tensor, "p h w"]) -> float:
    """Mean over pairs of the RMS difference over the pixels of ``mask``."""
    pixels = rgb[:, mask].double()
    distances = [
        float((one - other).square().mean().sqrt()) for one, other in combinations(pixels, 2)
    ]
    return math.fsum(distances) / len(distances)
