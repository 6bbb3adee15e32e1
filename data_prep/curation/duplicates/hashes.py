"""Clips that look alike, by their perceptual hashes.

Two clips are duplicates if on average at most ``bits`` of 64 bits differ over their three frames.
By the pigeonhole principle hashes that differ in few bits share one of several bands, so that only
clips with a band in common are compared: a hundred thousand clips take seconds.
"""

from collections import defaultdict
from collections.abc import Iterator

from diff4splat.data_prep.curation.clip_record import ClipRecord

_BITS = 64
_MOST_COMPARED = 2000
"""Per band: thousands of black or white frames share one, and all look alike anyway."""


def duplicates_of(ranked: list[ClipRecord], bits: int) -> Iterator[tuple[ClipRecord, ClipRecord]]:
    """Pairs of a duplicate and the better clip that it looks like; ``ranked`` best first."""
    remaining: dict[tuple[int, int, int], list[int]] = defaultdict(list)
    hashes: list[tuple[int, ...]] = []
    kept: list[ClipRecord] = []
    for record in ranked:
        found = _hashes(record)
        if found is None:
            continue
        candidates = {
            number for band in _bands(found, bits) for number in remaining[band][:_MOST_COMPARED]
        }
        alike = min((n for n in candidates if _alike(found, hashes[n], bits)), default=None)
        if alike is not None:
            yield record, kept[alike]
            continue
        for band in _bands(found, bits):
            remaining[band].append(len(kept))
        hashes.append(found)
        kept.append(record)


def _hashes(record: ClipRecord) -> tuple[int, ...] | None:
    parts = record.labels.get("hash", "").split()
    try:
        return tuple(int(part, 16) for part in parts) or None
    except ValueError:
        return None


def _bands(hashes: tuple[int, ...], bits: int) -> list[tuple[int, int, int]]:
    """(frame, band, bits of the band). A mean of ``bits`` puts one frame at or below it."""
    count = min(bits + 1, _BITS)
    width = _BITS // count
    mask = (1 << width) - 1
    return [
        (frame, band, (value >> (band * width)) & mask)
        for frame, value in enumerate(hashes)
        for band in range(count)
    ]


def _alike(first: tuple[int, ...], second: tuple[int, ...], bits: int) -> bool:
    if len(first) != len(second):
        return False
    differing = sum((a ^ b).bit_count() for a, b in zip(first, second, strict=True))
    return differing <= bits * len(first)
