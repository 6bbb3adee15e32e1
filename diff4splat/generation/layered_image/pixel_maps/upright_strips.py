"""Upright strips that are nearer than both sides, as towers, masts and trunks (ours, ADR 49).

Axes: ``h w`` pixels. Predicted depth of a tower before the sky wavers along its height, or grows
with it, and the tower bends or falls as soon as the camera moves. Inverse depth that is linear over
the image is a plane: a straight edge in it stays straight from everywhere. How much it may change
with height follows from the camera's pitch.
"""

import math
from collections.abc import Iterator

import cv2
import numpy as np
import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

NEARER = 1.15
"""Inverse depth over that of both sides, from which on a pixel may belong to a strip."""
WIDTH_SHARE = 1 / 8
"""Of the longer side: what is wider is no strip."""
LEAST_HEIGHT_SHARE = 1 / 8
LEAST_ELONGATION = 3.0
"""Height over width of the box around it."""
CORE_SHARE = 0.25
"""Of the most that the row is nearer than both sides: less is the blur of predicted depth."""
TIP_PX = 2
"""Rows above the uppermost one that belong to a strip: predicted depth blurs its tip away."""
MOST_PITCH_DEG = 10.0
"""Of cameras: what is upright has inverse depth (cos pitch − sin pitch · y / focal) / distance."""
ROUNDS = 20
LEAST_RESIDUAL = 1e-3
"""Of the mean: rows that are nearer to the line count alike."""


def straightened(depth: Float[Tensor, "h w"], focal_px: float) -> Float[Tensor, "h w"]:
    """``depth``, above 0, of upright strips as that of upright planes; blur beside them is gone."""
    inverse = (1 / depth.detach().double()).cpu().numpy()
    beside = _beside(inverse)
    result = inverse.copy()
    for strip, blurred in _strips(inverse, beside):
        rows, above = np.nonzero(strip)[0], _with_outline(strip)
        result[blurred] = beside[blurred]
        line = _line(rows, inverse[strip], math.tan(math.radians(MOST_PITCH_DEG)) / focal_px)
        result[above] = line[np.nonzero(above)[0]]
    return torch.from_numpy(1 / result).to(depth)


def _width_px(inverse: Float[np.ndarray, "h w"]) -> int:
    """Odd, so that no side of a wide surface is left."""
    return round(WIDTH_SHARE * max(inverse.shape)) | 1


def _beside(inverse: Float[np.ndarray, "h w"]) -> Float[np.ndarray, "h w"]:
    """Inverse depth without what is narrow in its row and nearer."""
    return cv2.morphologyEx(inverse, cv2.MORPH_OPEN, np.ones((1, _width_px(inverse))))


def _strips(
    inverse: Float[np.ndarray, "h w"], beside: Float[np.ndarray, "h w"]
) -> Iterator[tuple[Bool[np.ndarray, "h w"], Bool[np.ndarray, "h w"]]]:
    """Upright connected components, and the blur around each of them."""
    nearer = inverse - beside
    peak = cv2.dilate(nearer, np.ones((1, _width_px(inverse) // 2 | 1)))
    core = nearer >= CORE_SHARE * peak
    candidates = (inverse > NEARER * beside).astype(np.uint8)
    count, component, statistics, _ = cv2.connectedComponentsWithStats(candidates, connectivity=8)
    for number in range(1, count):
        found = component == number
        # Blur of a nearer strip beside it may be all that there is.
        if _is_upright(statistics[number], inverse.shape) and core[found].any():
            yield found & core, found & ~core


def _is_upright(statistics: Int[np.ndarray, " s"], size_px: tuple[int, int]) -> bool:
    """Whether a component is high, narrow, not aslant, and has both its sides in the image."""
    left, width, height = statistics[[cv2.CC_STAT_LEFT, cv2.CC_STAT_WIDTH, cv2.CC_STAT_HEIGHT]]
    is_inside = left > 0 and left + width < size_px[1]
    is_narrow = height >= LEAST_ELONGATION * width
    return bool(is_inside and is_narrow and height >= LEAST_HEIGHT_SHARE * max(size_px))


def _with_outline(strip: Bool[np.ndarray, "h w"]) -> Bool[np.ndarray, "h w"]:
    """With the pixels around it, and rows above: edges are drawn to those of colours later."""
    grown = cv2.dilate(strip.astype(np.uint8), np.ones((3, 3)))
    return cv2.dilate(grown, np.ones((TIP_PX + 1, 1)), anchor=(0, 0)) > 0


def _line(
    rows: np.ndarray, inverse: Float[np.ndarray, " n"], most_slope: float
) -> Float[np.ndarray, " h"]:
    """Inverse depth of every row up to the one below the last.

    The least absolute distance from the rows' medians, by iteratively reweighted least squares
    (Weiszfeld). Where the line is steeper than ``most_slope`` of its foot, the foot stays.
    """
    at = np.unique(rows)
    medians = np.array([np.median(inverse[rows == row]) for row in at])
    terms = np.stack([np.ones(len(at)), at - at[-1]], 1)
    weight = np.ones(len(at))
    for _ in range(ROUNDS):
        line = np.linalg.lstsq(terms * weight[:, None], medians * weight, rcond=None)[0]
        distance = np.abs(medians - terms @ line)
        weight = np.maximum(distance, LEAST_RESIDUAL * medians.mean()) ** -0.5
    foot = max(line[0], medians.min() / 2)
    slope = np.clip(line[1], -most_slope * foot, most_slope * foot)
    return np.maximum(foot + slope * (np.arange(at[-1] + 2) - at[-1]), medians.min() / 2)
