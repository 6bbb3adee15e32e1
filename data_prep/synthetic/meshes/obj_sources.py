"""Where OBJ files are: folders, and libraries of Sweet Home 3D (``.sh3f``, a ZIP with a catalogue).

A source yields one entry per mesh, with all files that lie beside it.
"""

import re
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from diff4splat.errors import FileFormatError, InputError

MOST_BYTES = 200_000_000
"""Of one mesh with its images, unpacked."""
_CATALOG = "PluginFurnitureCatalog.properties"
_LINE = re.compile(r"^(name|model|height|creator)#(\d+)=(.*)$", re.MULTILINE)
_CM = 0.01


@dataclass(frozen=True, slots=True, kw_only=True)
class ObjEntry:
    """One mesh and what its library says of it."""

    name: str
    """In the library's words, lower case."""
    place: str
    """Of the OBJ file in its source, for messages."""
    creator: str
    height_m: float | None
    obj: bytes
    beside: dict[str, bytes]
    """Other files of its folder."""


def obj_entries(source: Path) -> Iterator[ObjEntry]:
    """All meshes of a folder or of a library file.

    Raises:
        FileFormatError: no such library.
        InputError: a folder without OBJ files.
    """
    return _library_entries(source) if source.is_file() else _folder_entries(source)


def count_entries(source: Path) -> int:
    """How many meshes there are, without reading them."""
    if source.is_file():
        with _opened(source) as archive:
            return len(_catalog(archive))
    return len(list(source.rglob("*.obj")))


def _folder_entries(source: Path) -> Iterator[ObjEntry]:
    files = sorted(source.rglob("*.obj"))
    if not files:
        raise InputError(f"{source}: expected .obj files in it, got none; check the path")
    for file in files:
        beside = {one.name: one for one in file.parent.iterdir() if one.is_file()}
        size = sum(one.stat().st_size for one in beside.values())
        yield ObjEntry(
            name=file.stem.lower(),
            place=str(file),
            creator="",
            height_m=None,
            obj=file.read_bytes(),
            beside={name: one.read_bytes() for name, one in beside.items()}
            if size <= MOST_BYTES
            else {},
        )


def _library_entries(source: Path) -> Iterator[ObjEntry]:
    with _opened(source) as archive:
        infos = archive.infolist()
        for fields in _catalog(archive):
            model = fields["model"].lstrip("/")
            folder = str(PurePosixPath(model).parent) + "/"
            inside = [one for one in infos if one.filename.startswith(folder) and not one.is_dir()]
            if sum(one.file_size for one in inside) > MOST_BYTES:
                continue
            files = {one.filename[len(folder) :]: archive.read(one) for one in inside}
            height = fields.get("height", "")
            yield ObjEntry(
                name=fields["name"].lower(),
                place=model,
                creator=fields.get("creator", ""),
                height_m=_CM * float(height) if re.fullmatch(r"[\d.]+", height) else None,
                obj=files.pop(PurePosixPath(model).name, b""),
                beside=files,
            )


def _opened(source: Path) -> zipfile.ZipFile:
    try:
        return zipfile.ZipFile(source)
    except (OSError, zipfile.BadZipFile) as error:
        raise FileFormatError(f"{source}: expected a ZIP file, got {error}") from error


def _catalog(archive: zipfile.ZipFile) -> list[dict[str, str]]:
    """Fields of every OBJ mesh of the catalogue, in its order."""
    try:
        text = archive.read(_CATALOG).decode("iso-8859-1")
    except KeyError as error:
        raise FileFormatError(
            f"{archive.filename}: expected {_CATALOG} in it, got none; is it a Sweet Home 3D "
            "library?"
        ) from error
    entries: dict[int, dict[str, str]] = {}
    for key, number, value in _LINE.findall(text):
        entries.setdefault(int(number), {})[key] = value.strip()
    found = [entries[number] for number in sorted(entries)]
    return [one for one in found if "name" in one and one.get("model", "").endswith(".obj")]
