"""Procedural clips into a folder of shards: several processes draw, one writes, in order.

Clips are named by seed, split and index, so a run that was stopped goes on where it was, and equal
requests give equal bytes whatever the number of processes.
"""

import multiprocessing
import os
from collections.abc import Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

from diff4splat.data.members.encode import EncodedClip, encode_clip
from diff4splat.data.shard_writer import ShardOptions, ShardWriter
from diff4splat.data_prep.synthetic.drawing.clips import draw_clip
from diff4splat.data_prep.synthetic.drawing.settings import DrawSettings
from diff4splat.data_prep.synthetic.narration import SOURCE
from diff4splat.data_prep.synthetic.worlds import WorldRecipe, make_world, world_identifier
from diff4splat.errors import ConfigError
from diff4splat.report.phases import Phases


@dataclass(frozen=True, slots=True, kw_only=True)
class WorldJob:
    """Which clips, and how they are drawn."""

    folder: Path
    clips: int
    recipe: WorldRecipe
    first: int = 0
    """Index of the first world."""
    draw: DrawSettings = field(default_factory=DrawSettings)
    workers: int = 1

    def __post_init__(self) -> None:
        if self.clips < 1 or self.workers < 1 or self.first < 0:
            raise ConfigError(
                "prepare synth: expected --clips and --workers of at least 1 and --first of at "
                f"least 0, got {self.clips}, {self.workers} and {self.first}"
            )


def write_worlds(job: WorldJob, phases: Phases, append: bool = False) -> int:
    """Write all clips of the job that the folder does not hold yet; returns how many those were.

    Raises:
        OutputError: the folder has clips and ``append`` is False, or cannot be written.
    """
    options = ShardOptions(generator=SOURCE)
    with ShardWriter(job.folder, options, append) as writer:
        indices = [
            index
            for index in range(job.first, job.first + job.clips)
            if world_identifier(job.recipe, index) not in writer.identifiers
        ]
        with phases.phase("draw clips", len(indices)) as advance:
            for clip in _drawn(job, indices):
                writer.write(clip)
                advance()
    return len(indices)


def _drawn(job: WorldJob, indices: list[int]) -> Iterator[EncodedClip]:
    """Encoded clips in the order of ``indices``."""
    if job.workers == 1:
        yield from (_draw(job.recipe, job.draw, index) for index in indices)
        return
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(job.workers, context, initializer=_one_thread) as pool:
        # A few ahead keeps workers busy without holding every clip in memory.
        waiting: list[Future[EncodedClip]] = []
        for index in indices:
            waiting.append(pool.submit(_draw, job.recipe, job.draw, index))
            if len(waiting) > 2 * job.workers:
                yield waiting.pop(0).result()
        for future in waiting:
            yield future.result()


def _one_thread() -> None:
    os.environ["OMP_NUM_THREADS"] = "1"


def _draw(recipe: WorldRecipe, draw: DrawSettings, index: int) -> EncodedClip:
    return encode_clip(draw_clip(make_world(recipe, index), draw))
