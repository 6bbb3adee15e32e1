"""Depth of any kind in scene units: the median is the plane's depth, 4.

Depths up to a factor need no more than that. Inverse depth up to an offset, which most depth
networks give, lacks one number: where infinity is. ``offset`` finds it.
"""

from dataclasses import dataclass

import numpy as np

from diff4splat.errors import InputError
from diff4splat.generation.given_depth.holes import fill_holes
from diff4splat.generation.given_depth.offset import Offset, find_offset
from diff4splat.models.depth_priors.kinds import METRES_PER_UNIT, DepthKind
from diff4splat.models.ldrm.plane_prior import PLANE_DEPTH

NEAREST, FARTHEST = PLANE_DEPTH / 16, PLANE_DEPTH * 16
"""Scene units that depth is kept within; beyond, parallax and error are below a pixel."""
LEAST_RANGE = 1e-5
"""Of the values, relative to the largest; below, a map is constant."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AnchoredDepth:
    """Depth in scene units."""

    depth: np.ndarray
    """(h, w) float32, z, finite and above 0."""
    metres_per_unit: float | None
    """None where the map has no unit."""
    offset: Offset | None
    """How the offset of inverse depth was found; None for other kinds."""


def anchor(
    values: np.ndarray, kind: DepthKind, tangents: tuple[np.ndarray, np.ndarray]
) -> AnchoredDepth:
    """Values (h, w) of a ``kind`` in scene units.

    ``tangents`` are x/z of the columns and y/z of the rows.

    Raises:
        InputError: nothing is known, or all is the same.
    """
    values = values.astype(np.float32)
    if kind in ("disparity", "inverse"):
        return _anchor_inverse(values, kind, tangents)
    if kind == "distance":
        x, y = (tangent.astype(np.float32) for tangent in tangents)
        values = values / np.sqrt(1 + x[None] ** 2 + y[:, None] ** 2)
    z = np.where(values > 0, values, np.nan)
    known = z[np.isfinite(z)]
    _require_depth(known, kind)
    unit = float(np.median(known)) / PLANE_DEPTH
    metres = METRES_PER_UNIT.get(kind)
    return AnchoredDepth(
        depth=_finished(z / unit),
        metres_per_unit=None if metres is None else unit * metres,
        offset=None,
    )


def _anchor_inverse(
    values: np.ndarray, kind: DepthKind, tangents: tuple[np.ndarray, np.ndarray]
) -> AnchoredDepth:
    values = np.where(np.isfinite(values), values, np.nan)
    known = values[np.isfinite(values)]
    _require_depth(known, kind)
    zero = Offset(infinity=0.0, why="0 is infinitely far, as stated")
    offset = zero if kind == "disparity" else find_offset(values, tangents)
    inverse = values - np.float32(offset.infinity)
    above = inverse[inverse > 0]
    if not above.size:
        raise InputError("depth map: expected disparity above 0, got none; is it --depth-kind z?")
    with np.errstate(divide="ignore", invalid="ignore"):
        z = np.where(inverse > 0, 1 / inverse, np.inf)
    z = np.where(np.isfinite(values), z, np.nan)
    unit = np.float32(np.median(z[np.isfinite(z)])) / np.float32(PLANE_DEPTH)
    return AnchoredDepth(depth=_finished(z / unit), metres_per_unit=None, offset=offset)


def _finished(depth: np.ndarray) -> np.ndarray:
    with np.errstate(invalid="ignore"):
        kept = np.clip(depth, NEAREST, FARTHEST)
    return fill_holes(np.where(np.isnan(depth), np.nan, kept), FARTHEST).astype(np.float32)


def _require_depth(known: np.ndarray, kind: DepthKind) -> None:
    if not known.size:
        raise InputError(
            f"depth map: expected known pixels, got none ({kind}); check the map, or --depth-kind"
        )
    low, high = float(known.min()), float(known.max())
    if high - low <= LEAST_RANGE * max(abs(low), abs(high)):
        raise InputError(
            f"depth map: expected depth that varies, got {low:g} in every pixel; check the map, or "
            "leave out --depth"
        )
