"""Images of cutouts before photographs, as clips of one frame in a folder of shards.

    cutouts, their nouns ─┐
    photographs ──────────┴─ composite ─ clip of one frame with notes of its objects ─ shards

Image number n depends on the job and n alone, so a run that was stopped goes on where it was.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from diff4splat.data.clip import Clip, ClipMetadata, ObjectNote, View
from diff4splat.data.shard_writer import ShardOptions, ShardWriter
from diff4splat.data_prep.cutouts.composite import Composite, PastedObject, compose
from diff4splat.data_prep.cutouts.cutout import Cutout, find_cutouts, read_cutout, read_names
from diff4splat.errors import ConfigError
from diff4splat.geometry.camera import pinhole, stack_cameras
from diff4splat.io.photos.find import find_photographs
from diff4splat.io.photos.images import read_photo
from diff4splat.io.pixels import to_bytes
from diff4splat.progress.phases import Phases

SOURCE = "diff4splat cutouts 1"
COUNTS = (1, 1, 2, 2, 3, 3, 4, 5)
"""Cutouts of an image, one of these."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CutoutJob:
    """Which images, and what they are made of."""

    cutouts: Path
    names: Path
    """JSON: file names without suffix → nouns."""
    photographs: Path
    folder: Path
    license: str
    """Of the cutouts and photographs together."""
    images: int
    size_px: int = 128
    seed: int = 0
    keep_colors: bool = False
    """Of the cutouts; otherwise some get others, and textures."""

    def __post_init__(self) -> None:
        if self.images < 1 or self.size_px < 8 or self.seed < 0:
            raise ConfigError(
                "prepare cutouts: expected at least 1 image of 8 px and a seed of at least 0, got "
                f"{self.images}, {self.size_px} and {self.seed}"
            )


def write_cutouts(job: CutoutJob, phases: Phases, append: bool = False) -> int:
    """Write the images that the folder does not hold yet; returns how many those were.

    Raises:
        FileFormatError, InputError: a table, a cutout or a photograph cannot be used.
        OutputError: the folder has clips and ``append`` is False, or cannot be written.
    """
    cutouts = find_cutouts(job.cutouts, read_names(job.names))
    photographs = find_photographs(job.photographs, "--photographs")
    with ShardWriter(job.folder, ShardOptions(generator=SOURCE), append) as writer:
        names = {identifier(job, number): number for number in range(job.images)}
        left = [number for name, number in names.items() if name not in writer.identifiers]
        with phases.phase("compose images", len(left)) as advance:
            for number in left:
                random = np.random.default_rng([job.seed, number])
                chosen = draw_cutouts(cutouts, random)
                file = photographs[int(random.integers(len(photographs)))]
                photograph = to_bytes(read_photo(file, convert=True).rgb)
                sides = (job.size_px, job.size_px)
                composite = compose(photograph, chosen, sides, random, job.keep_colors)
                writer.write(clip_of(composite, identifier(job, number), job.license))
                advance()
    return len(left)


def identifier(job: CutoutJob, number: int) -> str:
    """Name of an image's clip."""
    return f"cutouts-{job.size_px}-{job.seed}-{number:06d}"


def draw_cutouts(cutouts: dict[str, list[Path]], random: np.random.Generator) -> list[Cutout]:
    """One to five; every noun is as likely as another, however many cutouts it has."""
    nouns = list(cutouts)
    count = min(int(random.choice(COUNTS)), len(nouns))
    chosen = []
    for index in random.choice(len(nouns), count, replace=False):
        files = cutouts[nouns[index]]
        file = files[int(random.integers(len(files)))]
        chosen.append(read_cutout(file, nouns[index]))
    return chosen


def clip_of(composite: Composite, name: str, license_name: str) -> Clip:
    """One frame of one camera; nothing is known of depth or motion."""
    height, width = composite.numbers.shape
    camera = pinhole(float(width), (height, width), torch.float64)
    view = View(
        rgb=torch.from_numpy(composite.rgb)[None],
        depth=None,
        cameras=stack_cameras([camera]),
        instances=torch.from_numpy(composite.numbers)[None],
    )
    notes = tuple(_note(number, one) for number, one in enumerate(composite.objects, 1))
    note = ClipMetadata(
        identifier=name, source=SOURCE, license=license_name, objects=notes, is_static=True
    )
    return Clip(note=note, times_s=torch.zeros(1, dtype=torch.float64), views=(view,))


def _note(number: int, one: PastedObject) -> ObjectNote:
    return ObjectNote(instance=number, name=one.noun, color=one.color, motion="")
