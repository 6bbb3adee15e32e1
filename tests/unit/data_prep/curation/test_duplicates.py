"""Clips that look alike by their features: copies are found, others are not, on every machine."""

import cv2
import numpy as np
import pytest

from diff4splat.data_prep.curation.clip_record import ClipRecord
from diff4splat.data_prep.curation.decisions import decide
from diff4splat.data_prep.curation.duplicates import cells
from diff4splat.data_prep.curation.duplicates.cells import alike_features, nearest_cells
from diff4splat.data_prep.curation.duplicates.features import (
    LENGTH,
    clip_features,
    features_text,
    read_features,
)
from diff4splat.data_prep.curation.duplicates.hashes import duplicates_of
from diff4splat.data_prep.curation.stages.fingerprints import perceptual_hash
from diff4splat.data_prep.curation.thresholds import read_thresholds


def scene(seed: int, shift_px: int = 0) -> np.ndarray:
    """Three frames of blobs, boxes and a horizon."""
    rng = np.random.default_rng(seed)
    wide = np.empty((120, 260, 3), np.uint8)
    wide[:] = rng.integers(0, 255, 3)
    wide[int(rng.integers(30, 90)) :] = rng.integers(0, 255, 3)
    for _ in range(12):
        x, y = int(rng.integers(260)), int(rng.integers(120))
        color, side = rng.integers(0, 255, 3).tolist(), int(rng.integers(8, 40))
        if rng.random() < 0.5:
            cv2.circle(wide, (x, y), side, color, -1)
        else:
            cv2.rectangle(wide, (x, y), (x + side, y + 2 * side), color, -1)
    starts = [40 + shift_px + 3 * frame for frame in range(3)]
    return np.stack([wide[:, start : start + 160] for start in starts])


def encoded_again(frames: np.ndarray) -> np.ndarray:
    """Another size, darker, through JPEG of low quality, and cut at the edges."""
    made = []
    for frame in frames:
        darker = (frame * 0.85).astype(np.uint8)[1:-1, 2:-2]
        small = cv2.resize(darker, (128, 96), interpolation=cv2.INTER_AREA)
        _, content = cv2.imencode(".jpg", small, [cv2.IMWRITE_JPEG_QUALITY, 60])
        made.append(cv2.imdecode(content, cv2.IMREAD_COLOR))
    return np.stack(made)


def record(name: str, frames: np.ndarray, quality: float = 1.0) -> ClipRecord:
    hashes = " ".join(f"{perceptual_hash(frame):016x}" for frame in frames)
    labels = {"features": features_text(clip_features(frames)), "hash": hashes}
    scores = {"quality": float(quality)}
    return ClipRecord(identifier=name, dataset="set", scores=scores, labels=labels)


def cosine(first: np.ndarray, second: np.ndarray) -> float:
    a, b = clip_features(first).astype(float), clip_features(second).astype(float)
    return float(a @ b / np.sqrt((a @ a) * (b @ b)))


def test_copies_are_alike_and_other_scenes_are_not() -> None:
    scenes = [scene(seed) for seed in range(30)]
    copies = [cosine(one, encoded_again(one)) for one in scenes]
    others = [cosine(one, two) for n, one in enumerate(scenes) for two in scenes[:n]]
    assert min(copies) > 0.97
    assert max(others) < 0.8


def test_copies_are_found_whose_hashes_differ() -> None:
    scenes = [scene(seed) for seed in range(12)]
    ranked = [record(str(n), one, 8) for n, one in enumerate(scenes)]
    ranked += [record(f"copy of {n}", encoded_again(one), 5) for n, one in enumerate(scenes)]
    by_hash = {a.identifier for a, _ in duplicates_of(ranked, 3)}
    found = {a.identifier: b.identifier for a, b in alike_features(ranked, 0.97)}
    assert found == {f"copy of {n}": str(n) for n in range(12)}
    assert len(by_hash) < 12, "or hashes alone would do"
    decisions = {d.record.identifier: d for d in decide(ranked, read_thresholds(None))}
    rejected = {name for name, d in decisions.items() if not d.is_selected}
    assert rejected == set(found)
    texts = {decisions[name].reasons[0].text for name in rejected - by_hash}
    assert texts == {"looks like a better clip"}


def test_cells_keep_copies_together_and_do_not_depend_on_libraries(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    scenes = [scene(seed) for seed in range(40)]
    features = np.stack(
        [clip_features(one) for each in scenes for one in (each, encoded_again(each))]
    ).astype(np.float64)
    found = nearest_cells(features, 5)
    assert len(set(found.tolist())) == 5
    assert np.mean(found[::2] == found[1::2]) > 0.95
    # Sums in another order are exactly the same: whole numbers.
    order = np.random.default_rng(0).permutation(LENGTH)
    np.testing.assert_array_equal(nearest_cells(features[:, order], 5), found)
    monkeypatch.setattr(cells, "_CHUNK", 7)
    np.testing.assert_array_equal(nearest_cells(features, 5), found)


@pytest.mark.parametrize("text", ["", "not base64!", "AAAA", "é"])
def test_damaged_features_are_none(text: str) -> None:
    assert read_features(text) is None
    broken = ClipRecord(identifier="a", labels={"features": text})
    assert list(alike_features([broken, broken], 0.5)) == []


def test_images_without_structure_are_nobodys_duplicates() -> None:
    flat = np.full((3, 20, 30, 3), 90, np.uint8)
    assert not clip_features(flat).any()
    grey = [record(str(n), flat) for n in range(3)]
    assert list(alike_features(grey, 0.1)) == []
    assert list(alike_features([record("a", scene(1)), record("b", scene(1))], 2.0)) == []
    assert (
        read_features(features_text(clip_features(scene(1)))).tolist()
        == clip_features(scene(1)).tolist()
    )
