"""A model folder in the layout of diffusers, which others made: nothing in it is trusted.

    model_index.json  transformer/  vae/  text_encoder/  tokenizer/  scheduler/

Files must lie in the folder. The download cache of the Hugging Face hub keeps them beside it and
links to them (``snapshots/<revision>/x → ../../blobs/<hash>``); only there links may lead out.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from diff4splat.errors import CheckpointError, FileFormatError
from diff4splat.io.file_digest import file_sha256
from diff4splat.io.require_file import is_file, read_text
from diff4splat.paths.formats.json_text import decode_json

SUMS_FILE = "SHA256SUMS"
_SUM = re.compile(r"([0-9a-f]{64})  (\S+)")


@dataclass(frozen=True, slots=True, kw_only=True)
class SourceFolder:
    """The folder, and where its files may lie."""

    root: Path

    def file(self, name: str) -> Path:
        """A file of the folder, checked against its hash where one is known.

        Raises:
            CheckpointError: there is none, or it is a link that leads out of the folder.
            FileFormatError: it does not have its hash.
        """
        path = self.root / name
        if not is_file(path):
            raise CheckpointError(
                f"{path}: expected a file of a model folder, got none; download the model again"
            )
        resolved = path.resolve()
        if not any(resolved.is_relative_to(home) for home in self._homes()):
            raise CheckpointError(
                f"{path}: expected a file inside {self.root}, got a link to {resolved}; "
                "copy the file itself into the folder"
            )
        return path

    def verified(self, name: str) -> Path:
        """The same, with its content compared to the hash that the folder states, if any."""
        path = self.file(name)
        wanted = self._stated_hash(path, name)
        if wanted and (got := file_sha256(path)) != wanted:
            raise FileFormatError(
                f"{path}: expected SHA-256 {wanted[:16]}…, got {got[:16]}…; "
                "the file is damaged, download it again"
            )
        return path

    def json(self, name: str) -> Mapping[str, Any]:
        """A JSON object.

        Raises:
            CheckpointError: no such file, or something else in it.
        """
        path = self.file(name)
        text = read_text(path, "a JSON object", CheckpointError)
        try:
            data = decode_json(text)
        except FileFormatError as error:
            raise CheckpointError(f"{path}: expected a JSON object, {error}") from error
        if not isinstance(data, Mapping):
            raise CheckpointError(
                f"{path}: expected a JSON object, got {type(data).__name__}; download it again"
            )
        return data

    def has(self, name: str) -> bool:
        """Whether the folder has such a file."""
        return is_file(self.root / name)

    def _homes(self) -> list[Path]:
        root = self.root.resolve()
        cached = root.parent.name == "snapshots"
        return [root, root.parent.parent / "blobs"] if cached else [root]

    def _stated_hash(self, path: Path, name: str) -> str:
        """From a list of checksums, or from the name that a download cache gives the file."""
        if self.has(SUMS_FILE):
            lines = read_text(self.file(SUMS_FILE), "a list of checksums", CheckpointError)
            sums = {
                match[2]: match[1] for match in map(_SUM.fullmatch, lines.splitlines()) if match
            }
            return sums.get(name, "")
        blob = path.resolve()
        named = blob.parent.name == "blobs" and re.fullmatch(r"[0-9a-f]{64}", blob.name)
        return blob.name if named else ""


def require_class(config: Mapping[str, Any], known: tuple[str, ...], where: str) -> str:
    """The class that a configuration names, which must be among ``known``.

    Raises:
        CheckpointError: another architecture.
    """
    found = config.get("_class_name") or (config.get("architectures") or [None])[0]
    if found not in known:
        raise CheckpointError(
            f"{where}: expected the architecture {' or '.join(known)}, got {str(found)[:60]!r}; "
            "this model cannot be imported"
        )
    return found


def require_same(transformer: Mapping[str, Any], **wanted: int) -> None:
    """Parts of one model: as many channels and as wide text states on both sides.

    Raises:
        CheckpointError: the folder mixes models.
    """
    for name, value in wanted.items():
        if transformer.get(name) != value:
            raise CheckpointError(
                f"transformer/config.json: expected {name} to be {value} as in the other parts, "
                f"got {transformer.get(name)}; the folder mixes models"
            )
