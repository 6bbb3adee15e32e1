"""Stored results with other values than an evaluation writes."""

import json
from pathlib import Path

import pytest

from diff4splat.errors import FileFormatError
from diff4splat.evaluation.records import ItemResult, Score, Skip
from diff4splat.evaluation.report.result_store import ItemStore

KEY = "0123456789abcdef"


def _stored(folder: Path) -> Path:
    store = ItemStore(folder / "items.jsonl", KEY)
    scores = (Score(row="a", key="psnr", value=20.5, parts=(20.0, None)),)
    skips = (Skip(row="a", key="pose", why="no motion"),)
    store.add(ItemResult(item=0, clip="c", clip_sha256="0", scores=scores, skips=skips))
    return store.file


@pytest.mark.parametrize(
    "change",
    [
        *({"item": "0"}, {"item": [1]}, {"item": -1}, {"item": True}, {"clip": 3}),
        *({"scores": 3}, {"scores": [3]}, {"scores": [{"row": "a"}]}, {"skips": None}),
        {"scores": [{"row": "a", "key": "b", "value": "c", "parts": []}]},
        {"scores": [{"row": "a", "key": "b", "value": 10**400, "parts": []}]},
        {"scores": [{"row": "a", "key": "b", "value": 1.0, "parts": ["x"]}]},
        {"other": 1},
    ],
)
def test_items_of_other_values_are_refused(tmp_path: Path, change: dict) -> None:
    file = _stored(tmp_path)
    head, row = file.read_text().splitlines()
    file.write_text(f"{head}\n{json.dumps(json.loads(row) | change)}\n")
    with pytest.raises(FileFormatError, match="run with --fresh"):
        ItemStore(file, KEY)


@pytest.mark.parametrize("text", ["", "[" * 100_000, "9" * 5000, "[]", "null", "{}\n{"])
def test_files_of_other_text_are_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "items.jsonl").write_text(text)
    with pytest.raises(FileFormatError, match=r"items\.jsonl: expected"):
        ItemStore(tmp_path / "items.jsonl", KEY)
