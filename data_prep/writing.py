"""Procedural clips into a folder of shards: several processes draw, one writes, in order.

Clips are named by seed, split and index, so a run that was stopped goes on where it was, and equal
requests give equal bytes whatever the number of processes.
"""

import multiprocessing
import signal
from collections.abc import Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path

import torch

from diff4splat.data.codecs.encode import EncodedClip, encode_clip
from diff4splat.data.manifest import read_manifest
from diff4splat.data.shard_writer import ShardOptions, ShardWriter
from diff4splat.data_prep.synthetic.captioning import SOURCE
from diff4splat.data_prep.synthetic.renderer.clips import draw_clip
from diff4splat.data_prep.synthetic.renderer.jit import GROUP as DRAWING
from diff4splat.data_prep.synthetic.renderer.settings import DrawSettings
from diff4splat.data_prep.synthetic.renderer.without_objects import draw_without_objects
from diff4splat.data_prep.synthetic.worlds import WorldRecipe, make_world, world_identifier
from diff4splat.errors import ConfigError
from diff4splat.progress.interrupts import uninterrupted
from diff4splat.progress.phases import Phases
from diff4splat.progress.precompile import ensure_precompiled

MOST_OBJECTS = 7
"""That are taken away: eight views are the most that a clip of a world has."""


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
    without_objects: int = 0
    """Views of the first image that lack one object each, in place of the clip; 0 for the clip."""

    def __post_init__(self) -> None:
        if self.clips < 1 or self.workers < 1 or self.first < 0:
            raise ConfigError(
                "prepare synth: expected --clips and --workers of at least 1 and --first of at "
                f"least 0, got {self.clips}, {self.workers} and {self.first}"
            )
        if not 0 <= self.without_objects <= MOST_OBJECTS:
            raise ConfigError(
                f"prepare synth: expected --without-objects from 0 to {MOST_OBJECTS}, got "
                f"{self.without_objects}"
            )

    @property
    def indices(self) -> range:
        """Of the worlds."""
        return range(self.first, self.first + self.clips)


def write_worlds(job: WorldJob, phases: Phases, append: bool = False) -> int:
    """Write all clips of the job that the folder does not hold yet; returns how many those were.

    Raises:
        OutputError: the folder has clips and ``append`` is False, or cannot be written.
        ConfigError: clips of the same names are there that were drawn otherwise.
        KeyboardInterrupt: after what was drawn until then has been written.
    """
    stopped = None
    shard = ShardWriter(job.folder, ShardOptions(generator=SOURCE), append)
    with ExitStack() as last_shard, shard as writer:
        if writer.identifiers:
            _require_alike(job)
        names = {index: world_identifier(job.recipe, index) for index in job.indices}
        indices = [index for index, name in names.items() if name not in writer.identifiers]
        try:
            if indices:
                ensure_precompiled(DRAWING, phases)
            with phases.phase("draw clips", len(indices)) as advance:
                for clip in _drawn(job, indices):
                    writer.write(clip)
                    advance()
        except KeyboardInterrupt as interrupt:
            # Leaving the writer in peace names the open shard: hours of drawing may lie in it.
            last_shard.enter_context(uninterrupted())
            stopped = interrupt
    if stopped:
        raise stopped
    return len(indices)


def _require_alike(job: WorldJob) -> None:
    """Names say seed, split and index alone: clips of another size would be taken for done."""
    frames, views = job.recipe.frames, job.recipe.views
    if job.without_objects:
        frames, views = 1, 1 + job.without_objects
    wanted = (frames, views, job.recipe.size_px)
    names = {world_identifier(job.recipe, index) for index in job.indices}
    for entry in read_manifest(job.folder).clips:
        found = (entry.frames, entry.views, entry.size_px)
        if entry.identifier in names and found != wanted:
            raise ConfigError(
                f"{job.folder}: expected clip '{entry.identifier}' with (frames, views, size) "
                f"{wanted}, got it with {found}; choose another folder, --seed or --first"
            )


def _drawn(job: WorldJob, indices: list[int]) -> Iterator[EncodedClip]:
    """Encoded clips in the order of ``indices``."""
    if job.workers == 1:
        yield from (_draw(job, index) for index in indices)
        return
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(job.workers, context, initializer=_begin_worker)
    # A few ahead keeps workers busy without holding every clip in memory.
    waiting: list[Future[EncodedClip]] = []
    try:
        for index in indices:
            waiting.append(pool.submit(_draw, job, index))
            if len(waiting) > 2 * job.workers:
                yield waiting.pop(0).result()
        for future in waiting:
            yield future.result()
    finally:
        pool.shutdown(cancel_futures=True)


def _begin_worker() -> None:
    """One thread each; Ctrl-C is for the process that writes."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    torch.set_num_threads(1)


def _draw(job: WorldJob, index: int) -> EncodedClip:
    world = make_world(job.recipe, index)
    if job.without_objects:
        return encode_clip(draw_without_objects(world, job.without_objects, job.draw))
    return encode_clip(draw_clip(world, job.draw))
