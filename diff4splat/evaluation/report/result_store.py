"""Stored results: one JSON line per item, after a header line with the run key.

The file is rewritten under a temporary name after every item, so that an interrupt costs one item
and never leaves a partial line.
"""

import hashlib
import json
from dataclasses import asdict
from pathlib import Path

from diff4splat import __version__
from diff4splat.errors import FileFormatError
from diff4splat.evaluation.columns import columns_of
from diff4splat.evaluation.measure_item import Setup
from diff4splat.evaluation.records import ItemResult, read_item
from diff4splat.io.atomic import write_text
from diff4splat.io.require_file import read_text
from diff4splat.paths.formats.json_text import decode_json

FORMAT = "diff4splat-evaluation-items 1"
NAME = "items.jsonl"


def run_key(setup: Setup) -> str:
    """Hash of everything that changes results, in sixteen hexadecimal digits."""
    identity = {
        "protocol": setup.protocol.digest,
        "task": setup.task,
        "subject": asdict(setup.system.identity),
        "variants": [asdict(v.system.identity) | {"row": v.row} for v in setup.variants],
        "seeds": setup.seeds,
        "features": None if setup.features is None else setup.features.name,
        "videos": setup.videos.names,
        "captioner": setup.captioner.__qualname__,
        # Items that were stored before a column existed have no value for it.
        "columns": [column.key for column in columns_of(setup.task)],
        "diff4splat": __version__,
    }
    return hashlib.sha256(json.dumps(identity, sort_keys=True).encode()).hexdigest()[:16]


class ItemStore:
    """Stored items of one run."""

    def __init__(self, file: Path, key: str, fresh: bool = False) -> None:
        """Load the items of ``file`` if its key is ``key``.

        Raises:
            FileFormatError: the file is damaged.
        """
        self.file, self.key = file, key
        stored = [] if fresh else _read(file, key)
        self.items = {result.item: result for result in stored}

    def add(self, result: ItemResult) -> None:
        """Add one item and write the file.

        Raises:
            OutputError: the file cannot be written.
        """
        self.items[result.item] = result
        head = {"format": FORMAT, "key": self.key}
        rows = [self.items[item].to_json() for item in sorted(self.items)]
        lines = [json.dumps(row, allow_nan=False) for row in (head, *rows)]
        write_text(self.file, "\n".join(lines) + "\n")


def _read(file: Path, key: str) -> list[ItemResult]:
    if not file.is_file():
        return []
    try:
        text = read_text(file, "items of an evaluation")
        head, *rows = [decode_json(line) for line in text.splitlines()]
        is_valid = isinstance(head, dict) and head.get("format") == FORMAT
    except ValueError as error:
        raise _damaged(file) from error
    if not is_valid:
        raise _damaged(file)
    if head.get("key") != key:
        return []
    return [read_item(row, str(file)) for row in rows]


def _damaged(file: Path) -> FileFormatError:
    return FileFormatError(
        f"{file}: expected items of an evaluation, got something else; "
        "run with --fresh to measure anew"
    )
