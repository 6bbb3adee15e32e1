"""OBJ files into a mesh library.

folder or library ─ OBJ, materials, images ─ parts ─ few textures ─ height 1 ─ library file
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from diff4splat.data_prep.synthetic.meshes.library import (
    LibraryMesh,
    MeshNote,
    PartPlace,
    write_library,
)
from diff4splat.data_prep.synthetic.meshes.main_color import main_color
from diff4splat.data_prep.synthetic.meshes.obj_parts import read_obj
from diff4splat.data_prep.synthetic.meshes.obj_sources import ObjEntry, count_entries, obj_entries
from diff4splat.data_prep.synthetic.meshes.palette import TexturedPart, textured_parts
from diff4splat.errors import FileFormatError, InputError
from diff4splat.progress.phases import Phases

TEST_WORDS = frozenset(
    {
        *("arch", "banner", "barrel", "bottle", "caterpillar", "conifer", "cup", "cups", "fir"),
        *("gear", "heart", "mug", "pumpkin", "stool", "windmill"),
    }
)
"""Families that test worlds show and training worlds do not."""
LEAST_REPEATS = 1e-4
MOST_SLENDER = 50.0
"""Largest extent over the smallest of the others: wires and sheets are no objects."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MeshJob:
    """Which meshes become a library."""

    sources: Sequence[Path]
    file: Path
    license: str
    """SPDX name of the licence of all of them."""
    most_triangles: int = 30_000
    without: frozenset[str] = TEST_WORDS
    """Words of names that are left out."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MeshReport:
    """How many meshes were written, and why others were not."""

    written: int
    skipped: Counter[str]

    @property
    def reasons(self) -> str:
        """Of those that were not written, as the end of a sentence."""
        return f"; skipped {_said(self.skipped)}" if self.skipped else ""


def prepare_meshes(job: MeshJob, phases: Phases) -> MeshReport:
    """Write the library; a mesh that cannot be used is skipped.

    Raises:
        FileFormatError: a source is no library.
        InputError: no mesh of the sources can be used.
        OutputError: the file cannot be written.
    """
    meshes: list[LibraryMesh] = []
    skipped: Counter[str] = Counter()
    count = sum(count_entries(source) for source in job.sources)
    with phases.phase("read meshes", count) as advance:
        for source in job.sources:
            for entry in obj_entries(source):
                made = _mesh(entry, job)
                if isinstance(made, str):
                    skipped[made] += 1
                else:
                    meshes.append(made)
                advance()
    if not meshes:
        raise InputError(f"meshes: expected one that can be used, got none; {_said(skipped)}")
    write_library(meshes, job.file)
    return MeshReport(written=len(meshes), skipped=skipped)


def _said(skipped: Counter[str]) -> str:
    return ", ".join(f"{count} {reason}" for reason, count in skipped.most_common())


def _mesh(entry: ObjEntry, job: MeshJob) -> LibraryMesh | str:
    """The mesh, or why it cannot be used."""
    if set(entry.name.split()) & job.without:
        return "with a name of test worlds"
    try:
        parts = textured_parts(read_obj(entry.obj, entry.beside))
    except FileFormatError:
        return "damaged"
    triangles = sum(len(part.triangles) for part in parts)
    if not 0 < triangles <= job.most_triangles:
        return "without opaque triangles" if not triangles else "with too many triangles"
    found = _unit_height(parts)
    if found is None:
        return "without a volume"
    height, parts = found
    note = MeshNote(
        name=entry.name,
        creator=entry.creator,
        license=job.license,
        height_m=entry.height_m or height,
        color=main_color(parts),
        parts=_places(parts),
    )
    return LibraryMesh(note=note, parts=tuple(parts))


def _unit_height(parts: list[TexturedPart]) -> tuple[float, list[TexturedPart]] | None:
    """The height, and the parts of height 1, centred, with their lowest point on y = 0."""
    points = np.concatenate([part.vertices for part in parts]).astype(np.float64)
    low, high = points.min(0), points.max(0)
    extent = high - low
    height = float(extent[1])
    if not np.isfinite(extent).all() or float(np.sort(extent)[1]) * MOST_SLENDER < extent.max():
        return None
    if height * MOST_SLENDER < extent.max():
        return None
    shift = np.array([(low[0] + high[0]) / 2, high[1], (low[2] + high[2]) / 2], np.float32)
    moved = [
        replace(
            part,
            vertices=(part.vertices - shift) / height,
            repeats=max(part.repeats * height, 1e-4),
        )
        for part in parts
    ]
    return height, moved


def _places(parts: list[TexturedPart]) -> tuple[PartPlace, ...]:
    vertices = np.cumsum([len(part.vertices) for part in parts])
    triangles = np.cumsum([len(part.triangles) for part in parts])
    return tuple(
        PartPlace(vertices_end=int(v), triangles_end=int(t), repeats=part.repeats, gloss=part.gloss)
        for part, v, t in zip(parts, vertices, triangles, strict=True)
    )
