"""Inverse depth as a line of relative disparity: 1/z = scale · d + shift.

RANSAC over two points finds the line among outliers, then least squares with Tukey's weights on
the relative residual refines it. Relative, because noise of depth grows with depth: an absolute
residual of disparity would be ruled by near pixels. Axes: ``n`` samples.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64

from diff4splat.errors import InputError

_MAD_TO_DEVIATION = 1.4826
_LEAST_BAND = 1e-9
"""Relative; exact data have no spread to take a band from."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FitSettings:
    """RANSAC and reweighting."""

    tries: int = 200
    inlier_band: float = 0.10
    """Relative residual of an inlier."""
    tukey: float = 2.5
    """Residuals beyond as many deviations have no weight."""
    iterations: int = 30
    seed: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class DisparityFit:
    """The line and what supports it."""

    scale: float
    shift: float
    inliers: Bool[np.ndarray, " n"]
    relative_error: float
    """Median |z − z_reference| / z_reference over the inliers."""

    @property
    def inlier_share(self) -> float:
        """0 to 1."""
        return float(self.inliers.mean())


def fit_disparity(
    disparity: Float64[np.ndarray, " n"],
    inverse_depth: Float64[np.ndarray, " n"],
    settings: FitSettings | None = None,
) -> DisparityFit:
    """RANSAC, then iteratively reweighted least squares.

    Raises:
        InputError: fewer than two samples, or no line with a scale above 0 has inliers.
    """
    settings = settings or FitSettings()
    if len(disparity) < 2:
        raise InputError(f"alignment: expected two samples or more, got {len(disparity)}")
    scale, shift = _ransac(disparity, inverse_depth, settings)
    for _ in range(settings.iterations):
        before = scale, shift
        weight = _tukey(_residual(scale, shift, disparity, inverse_depth), settings)
        scale, shift = weighted_line(disparity, inverse_depth, weight / inverse_depth**2)
        if np.allclose(before, (scale, shift), rtol=1e-9, atol=0):
            break
    return described_fit(scale, shift, disparity, inverse_depth, settings)


def described_fit(
    scale: float,
    shift: float,
    disparity: Float64[np.ndarray, " n"],
    inverse_depth: Float64[np.ndarray, " n"],
    settings: FitSettings,
) -> DisparityFit:
    """A line with its inliers, whoever fitted it."""
    inliers = np.abs(_residual(scale, shift, disparity, inverse_depth)) < settings.inlier_band
    fitted = scale * disparity[inliers] + shift
    errors = np.abs(inverse_depth[inliers] / fitted - 1)
    error = float(np.median(errors)) if len(errors) else float("inf")
    return DisparityFit(
        scale=float(scale), shift=float(shift), inliers=inliers, relative_error=error
    )


def weighted_line(
    x: Float64[np.ndarray, " n"], y: Float64[np.ndarray, " n"], weight: Float64[np.ndarray, " n"]
) -> tuple[float, float]:
    """(slope, offset) of least Σ w (slope · x + offset − y)².

    Raises:
        InputError: the samples with weight are at one x.
    """
    total = weight.sum()
    if not total > 0:
        raise InputError("alignment: expected samples near one line, got none; check the reference")
    mean_x, mean_y = (weight * x).sum() / total, (weight * y).sum() / total
    spread = (weight * (x - mean_x) ** 2).sum()
    if not spread > 1e-20 * total * max(mean_x**2, 1e-300):
        raise InputError("alignment: expected disparity that varies, got one value everywhere")
    slope = float((weight * (x - mean_x) * (y - mean_y)).sum() / spread)
    return slope, float(mean_y - slope * mean_x)


def _residual(scale: float, shift: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return (scale * x + shift - y) / y


def _ransac(x: np.ndarray, y: np.ndarray, settings: FitSettings) -> tuple[float, float]:
    random = np.random.default_rng(settings.seed)
    first, second = random.integers(0, len(x), (2, settings.tries))
    best, found = 0.0, None
    for i, j in zip(first, second, strict=True):
        if x[i] == x[j]:
            continue
        scale = (y[i] - y[j]) / (x[i] - x[j])
        shift = y[i] - scale * x[i]
        if not scale > 0:
            continue
        gain = _gain(_residual(scale, shift, x, y), settings.inlier_band)
        if gain > best:
            best, found = gain, (float(scale), float(shift))
    if found is None:
        raise InputError(
            "alignment: expected inverse depth that grows with disparity, got none; the file may "
            "hold depth instead of disparity"
        )
    return found


def _gain(residual: np.ndarray, band: float) -> float:
    """Inliers, the closer the more: a plain count prefers lines that bend to other structures."""
    return float(np.maximum(1 - (residual / band) ** 2, 0).sum())


def _tukey(residual: np.ndarray, settings: FitSettings) -> np.ndarray:
    """Weights; the deviation is that of samples near the line, so that outliers do not widen it."""
    near = np.abs(residual) < 3 * settings.inlier_band
    middle = np.median(np.abs(residual[near])) if near.any() else 0.0
    band = max(settings.tukey * _MAD_TO_DEVIATION * middle, _LEAST_BAND)
    return np.where(np.abs(residual) < band, (1 - (residual / band) ** 2) ** 2, 0.0)
