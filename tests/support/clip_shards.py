"""Small folders of exact clips, and how stages of the ``test`` recipe read them."""

import json
import os
from collections.abc import Collection
from dataclasses import replace
from pathlib import Path

import torch
from oracles_clips import make_clip

from diff4splat.configs.recipes import recipe_by_name
from diff4splat.data.clip import Clip
from diff4splat.data.shard_writer import ShardOptions, ShardWriter
from diff4splat.training.batches.sources import EndlessClips
from diff4splat.training.recipe.data import SourceSettings
from diff4splat.training.recipe.recipe import Recipe

SIZE_PX, FRAMES = (32, 32), 5


def exact_clip(seed: int, static: bool) -> Clip:
    """Five frames of 32 × 32 from two views."""
    return make_clip(FRAMES, SIZE_PX, views=2, static=static, seed=seed, tracks=24)


def without_depth(clip: Clip) -> Clip:
    """The same clip with no truth of depth in its input view."""
    blind = replace(clip.views[0], depth=torch.zeros_like(clip.views[0].depth))
    return replace(clip, views=(blind, *clip.views[1:]), tracks=None)


def write_shards(
    folder: Path, still: int = 3, moving: int = 3, blind: Collection[int] = (), first: int = 0
) -> Path:
    """Clips in turns; names are numbers in the order of writing, ``blind`` ones have no depth."""
    with ShardWriter(folder, ShardOptions(generator="oracle 1")) as writer:
        for place in range(still + moving):
            static = place < still
            clip = exact_clip(first + place, static)
            if place in blind:
                views = tuple(
                    replace(view, track_uv=None, track_visible=None) for view in clip.views
                )
                clip = without_depth(replace(clip, views=views))
            writer.write(clip)
    return folder


def reading(folder: Path, steps: int = 2, still_share: float = 0.5) -> Recipe:
    """The ``test`` recipe, every stage reading the folder for so many steps."""
    recipe = recipe_by_name("test")
    source = SourceSettings(kind="shards", folder=str(folder), still_share=still_share)
    stages = [
        replace(stage, steps=steps, gates=(), data=replace(stage.data, sources=(source,)))
        for stage in recipe.stages
    ]
    return replace(recipe, stages=tuple(stages))


def changes(stage: str, folder: Path, steps: int = 2, still_share: float = 0.5) -> list[str]:
    """What ``--set`` takes to make one stage read the folder for so many steps."""
    source = {"kind": "shards", "folder": str(folder), "still_share": still_share}
    return [f"stages.{stage}.steps={steps}", f"stages.{stage}.data.sources={json.dumps([source])}"]


def process_and_name(clips: EndlessClips, index: int) -> tuple[int, str]:
    """For worker processes: who read which clip."""
    return os.getpid(), clips.clip(index).note.identifier
