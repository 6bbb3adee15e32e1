"""Clips whose features point the same way, compared within k-means cells alone.

Features, centres and so all products are whole numbers below 2**53: the cells, and what is a
duplicate of what, do not depend on the machine, its libraries or the number of threads.
Axes: ``n`` clips, ``k`` cells, ``d`` features.
"""

from collections.abc import Iterator

import numpy as np
from jaxtyping import Float64, Int64

from diff4splat.data_prep.curation.clip_record import ClipRecord
from diff4splat.data_prep.curation.duplicates.features import read_features

PER_CELL, ROUNDS = 1000, 8
"""Clips per cell on average, and iterations of k-means."""
_CENTRE_LENGTH = 1 << 12
_CHUNK = 8192


def alike_features(
    ranked: list[ClipRecord], least_cosine: float
) -> Iterator[tuple[ClipRecord, ClipRecord]]:
    """Pairs of a duplicate and the better clip that it looks like; ``ranked`` best first.

    Clips without features, or without any structure, are nobody's duplicates.
    """
    found = [(record, read_features(record.labels.get("features", ""))) for record in ranked]
    usable = [(record, values) for record, values in found if values is not None and values.any()]
    if len(usable) < 2 or least_cosine > 1:
        return
    records = [record for record, _ in usable]
    features = np.stack([values for _, values in usable]).astype(np.float64)
    cells = nearest_cells(features, -(-len(usable) // PER_CELL))
    for cell in range(int(cells.max()) + 1):
        members = np.flatnonzero(cells == cell)
        for place, better in _alike(features[members], least_cosine):
            yield records[members[place]], records[members[better]]


def nearest_cells(features: Float64[np.ndarray, "n d"], count: int) -> Int64[np.ndarray, " n"]:
    """The cell of every clip, by spherical k-means that starts at evenly spaced clips."""
    if count < 2:
        return np.zeros(len(features), np.int64)
    starts = np.linspace(0, len(features) - 1, count).astype(int)
    centres = _rounded(features[starts])
    for _ in range(ROUNDS):
        cells = _assigned(features, centres)
        sums = np.stack([features[cells == cell].sum(0) for cell in range(count)])
        # A cell that lost all its clips keeps its centre.
        centres = np.where(sums.any(1, keepdims=True), _rounded(sums), centres)
    return _assigned(features, centres)


def _assigned(
    features: Float64[np.ndarray, "n d"], centres: Float64[np.ndarray, "k d"]
) -> Int64[np.ndarray, " n"]:
    chunks = range(0, len(features), _CHUNK)
    return np.concatenate([(features[at : at + _CHUNK] @ centres.T).argmax(1) for at in chunks])


def _rounded(directions: Float64[np.ndarray, "k d"]) -> Float64[np.ndarray, "k d"]:
    """Whole numbers along the same directions, of about one length."""
    lengths = np.sqrt((directions**2).sum(1, keepdims=True))
    return np.round(directions * (_CENTRE_LENGTH / np.maximum(lengths, 1)))


def _alike(features: Float64[np.ndarray, "n d"], least: float) -> Iterator[tuple[int, int]]:
    """(place, place of a better one that remains) within one cell, best first."""
    lengths = np.sqrt((features**2).sum(1))
    kept: list[int] = []
    for place, values in enumerate(features):
        cosines = features[kept] @ values / (lengths[kept] * lengths[place])
        if kept and cosines.max() >= least:
            yield place, kept[int(cosines.argmax())]
        else:
            kept.append(place)
