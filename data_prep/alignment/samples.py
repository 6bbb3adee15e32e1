"""Pixels that a fit may use. Axes: ``t`` frames, ``h w`` pixels, ``n`` samples.

Sky, moving objects and depth edges are left out before any estimator sees them: masking matters
more than the estimator.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Float64, Int64

from diff4splat.errors import InputError

_FEWEST = 32


@dataclass(frozen=True, slots=True, kw_only=True)
class SampleSettings:
    """Which depths are used, and how many of them."""

    nearest: float = 0.3
    farthest: float = 80.0
    """Depths of the reference; metres where it is metric."""
    least_disparity: float = 0.05
    """Over the median of the clip. Below is sky, masked or not: smooth sky with a finite reference
    lies on a line of its own, and no estimator can tell which line is meant."""
    edge: float = 0.1
    """Largest relative difference of depth or disparity to the neighbours."""
    most: int = 50_000
    depth_bins: int = 16
    """In log-depth; none gives more samples than the others, so that near pixels do not rule."""
    seed: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class FitSamples:
    """Pairs of relative disparity and inverse depth."""

    disparity: Float64[np.ndarray, " n"]
    inverse_depth: Float64[np.ndarray, " n"]
    frame: Int64[np.ndarray, " n"]
    pixel: Int64[np.ndarray, " n"]
    """Row · width + column."""


def candidate_pixels(
    disparity: Float[np.ndarray, "t h w"],
    depth: Float[np.ndarray, "t h w"],
    excluded: Bool[np.ndarray, "t h w"],
    settings: SampleSettings,
) -> Bool[np.ndarray, "t h w"]:
    """Both known, in range, on smooth surfaces and not ``excluded`` (sky, moving)."""
    known = np.isfinite(disparity) & (disparity > 0) & np.isfinite(depth)
    if known.any():
        known &= disparity >= settings.least_disparity * np.median(disparity[known])
    with np.errstate(invalid="ignore"):
        in_range = (depth > settings.nearest) & (depth < settings.farthest)
    smooth = ~_edges(disparity, settings.edge) & ~_edges(depth, settings.edge)
    return known & in_range & smooth & ~excluded


def choose_samples(
    disparity: Float[np.ndarray, "t h w"],
    depth: Float[np.ndarray, "t h w"],
    candidates: Bool[np.ndarray, "t h w"],
    settings: SampleSettings,
) -> FitSamples:
    """Up to ``settings.most`` samples, spread over log-depth.

    Raises:
        InputError: fewer samples than any fit needs.
    """
    index = np.flatnonzero(candidates)
    if len(index) < _FEWEST:
        raise InputError(
            f"alignment: expected at least {_FEWEST} pixels with disparity and reference depth "
            f"that are neither sky nor moving, got {len(index)}; give a denser reference or "
            "check the masks"
        )
    chosen = _spread(index, np.log(depth.reshape(-1)[index].astype(np.float64)), settings)
    pixels = disparity.shape[1] * disparity.shape[2]
    return FitSamples(
        disparity=disparity.reshape(-1)[chosen].astype(np.float64),
        inverse_depth=1 / depth.reshape(-1)[chosen].astype(np.float64),
        frame=chosen // pixels,
        pixel=chosen % pixels,
    )


def _spread(index: np.ndarray, log_depth: np.ndarray, settings: SampleSettings) -> np.ndarray:
    if len(index) <= settings.most:
        return index
    random = np.random.default_rng(settings.seed)
    edges = np.linspace(log_depth.min(), log_depth.max(), settings.depth_bins + 1)[1:-1]
    bins = np.digitize(log_depth, edges)
    counts = np.bincount(bins, minlength=settings.depth_bins)
    quota = _level(counts, settings.most)
    picked = [
        random.choice(index[bins == number], min(quota, count), replace=False)
        for number, count in enumerate(counts)
        if count
    ]
    return np.sort(np.concatenate(picked))


def _level(counts: np.ndarray, total: int) -> int:
    """Largest quota per bin with which all bins together give up to ``total``."""
    low, high = 0, total
    while low < high:
        middle = (low + high + 1) // 2
        fits = np.minimum(counts, middle).sum() <= total
        low, high = (middle, high) if fits else (low, middle - 1)
    return low


def _edges(values: Float[np.ndarray, "t h w"], most: float) -> Bool[np.ndarray, "t h w"]:
    """Differs from a known neighbour by more than a share of itself."""
    edge = np.zeros(values.shape, bool)
    with np.errstate(invalid="ignore"):
        for axis in (1, 2):
            low = np.moveaxis(values, axis, 0)[:-1]
            high = np.moveaxis(values, axis, 0)[1:]
            jump = (low > 0) & (high > 0) & (np.abs(high - low) > most * np.minimum(low, high))
            marked = np.moveaxis(edge, axis, 0)
            marked[:-1] |= jump
            marked[1:] |= jump
    return edge
