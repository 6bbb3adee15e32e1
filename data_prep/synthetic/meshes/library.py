"""A mesh library: meshes of one unit's height in one ``.safetensors`` file, read one at a time.

Tensors ``<number>.vertices``, ``.triangles``, ``.uv`` and ``.images`` hold the parts of a mesh one
after another; the metadata's ``index`` says where each begins, its name, creator and licence.
"""

import hashlib
import json
from dataclasses import asdict, dataclass
from functools import cache, cached_property
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from diff4splat.captions.cutout_nouns import ALL_NOUNS
from diff4splat.captions.vocabulary import UNNAMED
from diff4splat.data_prep.synthetic.meshes.palette import TexturedPart
from diff4splat.data_prep.synthetic.rng import Rng
from diff4splat.data_prep.synthetic.shapes.shape import Part, PartImage, Shape
from diff4splat.data_prep.synthetic.shapes.surfaces.surface import surface
from diff4splat.errors import FileFormatError
from diff4splat.io.scene_files.tensor_file import TensorFile, read_metadata, write_tensors
from diff4splat.io.scene_files.tensor_slices import read_some

FORMAT = "diff4splat-meshes-1"
NOUNS_FILE = Path(__file__).parent / "sweet_home.json"
"""Names of Sweet Home 3D's libraries → nouns of captions; no noun of test families among them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PartPlace:
    """Where a part ends in its mesh's tensors, and how its image lies on it."""

    vertices_end: int
    triangles_end: int
    repeats: float
    gloss: float


@dataclass(frozen=True, slots=True, kw_only=True)
class MeshNote:
    """What the index says of a mesh."""

    name: str
    creator: str
    license: str
    height_m: float
    """Natural height."""
    color: str
    """Name of its main colour; empty for several."""
    parts: tuple[PartPlace, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class LibraryMesh:
    """A mesh to be written: parts of a mesh of height 1, on y = 0."""

    note: MeshNote
    parts: tuple[TexturedPart, ...]


def write_library(meshes: list[LibraryMesh], file: Path) -> None:
    """Write whole or not at all.

    Raises:
        OutputError: the folder cannot be made or written.
    """
    tensors: dict[str, Tensor] = {}
    for number, mesh in enumerate(meshes):
        for key in ("vertices", "triangles", "uv"):
            joined = np.concatenate([getattr(part, key) for part in mesh.parts])
            tensors[f"{number}.{key}"] = torch.from_numpy(joined)
        images = np.stack([part.image for part in mesh.parts])
        tensors[f"{number}.images"] = torch.from_numpy(images)
    index = json.dumps([asdict(mesh.note) for mesh in meshes])
    write_tensors(TensorFile(tensors=tensors, metadata={"format": FORMAT, "index": index}), file)


@dataclass(frozen=True)
class MeshLibrary:
    """The meshes of a file."""

    file: Path

    @cached_property
    def notes(self) -> tuple[MeshNote, ...]:
        """Of all meshes, by number."""
        return _notes(self.file)

    @cached_property
    def digest(self) -> str:
        """Eight letters that stand for the index."""
        text = read_metadata(self.file)["index"]
        return hashlib.sha256(text.encode()).hexdigest()[:8]

    @property
    def licenses(self) -> tuple[str, ...]:
        """Of its meshes."""
        return tuple(sorted({note.license for note in self.notes}))

    def draw_number(self, rng: Rng) -> int:
        """Number of any mesh, all names equally likely."""
        name = rng.child("name").choice(tuple(self._numbers))
        return rng.child("number").choice(self._numbers[name])

    @cached_property
    def _numbers(self) -> dict[str, list[int]]:
        """Of all meshes, by name, sorted."""
        found: dict[str, list[int]] = {}
        for number, note in enumerate(self.notes):
            found.setdefault(note.name, []).append(number)
        return dict(sorted(found.items()))

    def noun(self, number: int) -> str:
        """What captions call mesh ``number``: its name, or a noun for it; "object" without one."""
        name = self.notes[number].name
        return _nouns().get(name, name if name in ALL_NOUNS else UNNAMED)

    def shape(self, number: int) -> Shape:
        """Mesh ``number``, of height 1.

        Raises:
            FileFormatError: the file is damaged.
        """
        keys = ("vertices", "triangles", "uv", "images")
        found = read_some(self.file, [f"{number}.{key}" for key in keys])
        vertices, triangles, uv, images = (value.numpy() for value in found)
        note, parts, first_vertex, first_triangle = self.notes[number], [], 0, 0
        for place, image in zip(note.parts, images, strict=True):
            here = slice(first_vertex, place.vertices_end)
            piece = surface(
                vertices[here].astype(np.float64),
                triangles[first_triangle : place.triangles_end].astype(np.int32),
                uv[here].astype(np.float64) / place.repeats,
            )
            look = PartImage(
                pixels=image, repeats=place.repeats, gloss=place.gloss, color=note.color
            )
            parts.append(Part(role="painted", surface=piece, image=look))
            first_vertex, first_triangle = place.vertices_end, place.triangles_end
        return Shape(parts=tuple(parts))


@cache
def _nouns() -> dict[str, str]:
    return json.loads(NOUNS_FILE.read_text(encoding="utf-8"))


@cache
def open_library(file: Path) -> MeshLibrary:
    """The same object for the same file, so that a process reads its index once.

    Raises:
        FileFormatError: no mesh library.
    """
    library = MeshLibrary(file)
    if not library.notes:
        raise FileFormatError(f"{file}: expected meshes in it, got none")
    return library


def _notes(file: Path) -> tuple[MeshNote, ...]:
    metadata = read_metadata(file)
    if metadata.get("format") != FORMAT:
        raise FileFormatError(
            f"{file}: expected {FORMAT}, got {metadata.get('format', 'another kind of file')}; "
            "make it with diff4splat prepare meshes"
        )
    try:
        return tuple(
            MeshNote(**{**one, "parts": tuple(PartPlace(**place) for place in one["parts"])})
            for one in json.loads(metadata["index"])
        )
    except (KeyError, TypeError, ValueError) as error:
        raise FileFormatError(f"{file}: expected an index of meshes, got {error!r}") from error
