"""Captions in files beside clips: a folder of texts, JSON, JSON lines or CSV.

=========== =====================================================================
form        content
=========== =====================================================================
folder      ``KEY.txt`` per clip or scene
``.json``   one object, ``{"KEY": "caption", ...}``
``.jsonl``  one object per line, a key and a caption
``.csv``    a header line, then rows with a key and a caption; ``.tsv`` with tabs
=========== =====================================================================

Keys are the identifier of a clip, else its scene, which all clips of the scene share. Columns of
tables are called ``clip``, ``id``, ``scene``, ``video``, ``file_name`` or ``videoid`` for the key,
and ``caption``, ``text``, ``prompt`` or ``description`` for the caption.
"""

import csv
import io
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from diff4splat.data.clip import ClipMetadata
from diff4splat.errors import FileFormatError, InputError
from diff4splat.io.require_file import read_bytes
from diff4splat.paths.formats.json_text import decode_json

MOST_CHARACTERS = 4000
_MOST_BYTES, _MOST_TEXT_BYTES = 1 << 30, 1 << 16
_KEYS = ("clip", "id", "identifier", "scene", "video", "file_name", "videoid")
_CAPTIONS = ("caption", "text", "prompt", "description")


class SideCarCaptions:
    """Captions by key."""

    def __init__(self, source: Path) -> None:
        """Read a table; of a folder, each text is read when it is asked for.

        Raises:
            FileFormatError: missing, not of one of the forms, or damaged; says where.
        """
        self._folder = source if source.is_dir() else None
        self._captions = {} if source.is_dir() else _table(source)

    def caption(self, note: ClipMetadata) -> str:
        """The caption of a clip, else of its scene; empty if there is none.

        Raises:
            FileFormatError: its text is no UTF-8 or too long.
        """
        keys = (note.identifier, note.scene, f"{note.dataset}/{note.scene}")
        found = (self._of(key) for key in keys if key.strip("/"))
        return next((caption for caption in found if caption), "")

    def _of(self, key: str) -> str:
        if self._folder is None:
            return self._captions.get(key, "")
        # A scene may be called anything: only a plain name is a file of this folder.
        name = Path(key).name
        file = self._folder / f"{name}.txt"
        if name != key or not file.is_file():
            return ""
        return clean_caption(_decoded(file, _MOST_TEXT_BYTES), str(file))


def clean_caption(text: Any, where: str) -> str:
    """One line of text without control characters.

    Raises:
        FileFormatError: no text, or longer than 4000 characters.
    """
    if not isinstance(text, str):
        raise FileFormatError(f"{where}: expected a caption as text, got {text!r:.60}")
    plain = " ".join("".join(c if c.isprintable() else " " for c in text).split())
    if len(plain) > MOST_CHARACTERS:
        raise FileFormatError(
            f"{where}: expected a caption of up to {MOST_CHARACTERS} characters, got {len(plain)}; "
            "shorten it"
        )
    return plain


def _table(file: Path) -> dict[str, str]:
    suffix = file.suffix.lower()
    rows = {".json": _json, ".jsonl": _json_lines, ".csv": _csv, ".tsv": _csv}.get(suffix)
    if rows is None:
        raise FileFormatError(
            f"{file}: expected captions as .json, .jsonl, .csv, .tsv or a folder of .txt, got "
            f"'{suffix}'"
        )
    found: dict[str, str] = {}
    for where, key, text in rows(file):
        caption = clean_caption(text, where)
        if found.setdefault(key, caption) != caption:
            raise FileFormatError(f"{where}: expected one caption per key, got two for {key!r:.60}")
    return found


def _json(file: Path) -> Iterator[tuple[str, str, Any]]:
    root = decode_json(read_bytes(file, "captions", max_bytes=_MOST_BYTES))
    if not isinstance(root, dict):
        raise FileFormatError(f"{file}: expected one object of captions by key, got another value")
    yield from ((f"{file}, '{key}'", key, text) for key, text in root.items())


def _json_lines(file: Path) -> Iterator[tuple[str, str, Any]]:
    for number, line in enumerate(_decoded(file, _MOST_BYTES).splitlines(), 1):
        if not line.strip():
            continue
        where = f"{file}, line {number}"
        try:
            row = json.loads(line)
        except (ValueError, RecursionError) as error:
            raise FileFormatError(f"{where}: expected an object, got damaged JSON") from error
        if not isinstance(row, dict):
            raise FileFormatError(f"{where}: expected an object, got {row!r:.60}")
        yield (where, *_key_and_caption(row, where))


def _csv(file: Path) -> Iterator[tuple[str, str, Any]]:
    separator = "\t" if file.suffix.lower() == ".tsv" else ","
    text = io.StringIO(_decoded(file, _MOST_BYTES), newline="")
    try:
        for number, row in enumerate(csv.DictReader(text, delimiter=separator), 2):
            where = f"{file}, line {number}"
            yield (where, *_key_and_caption(row, where))
    except csv.Error as error:
        raise FileFormatError(f"{file}: expected a table, got '{error}'") from error


def _key_and_caption(row: dict[str, Any], where: str) -> tuple[str, Any]:
    names = {str(name).strip().lower(): name for name in row}
    key = next((row[names[name]] for name in _KEYS if name in names), None)
    caption = next((row[names[name]] for name in _CAPTIONS if name in names), None)
    if not isinstance(key, str) or not key or caption is None:
        raise FileFormatError(
            f"{where}: expected one of {', '.join(_KEYS)} and one of {', '.join(_CAPTIONS)}, got "
            f"{', '.join(sorted(names))[:80]}"
        )
    return key.strip(), caption


def _decoded(file: Path, most: int) -> str:
    try:
        return read_bytes(file, "captions", max_bytes=most).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise FileFormatError(
            f"{file}: expected UTF-8, got byte {error.start} of another"
        ) from error
    except InputError as error:
        raise FileFormatError(str(error)) from error
