"""Upright strips that are nearer than both sides, as towers, masts and trunks (ours, ADR 49).

Axes: ``h w`` pixels. Predicted depth of a tower before the sky wavers along its height, and the
tower bends as soon as the camera moves. Inverse depth that is linear over the image is a plane: a
straight edge in it stays straight from everywhere.
"""

from collections.abc import Iterator

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

NEARER = 1.15
"""Inverse depth over that of both sides, from which on a pixel belongs to a strip."""
WIDTH_SHARE = 1 / 8
"""Of the longer side: what is wider is no strip."""
LEAST_HEIGHT_SHARE = 1 / 8
LEAST_ELONGATION = 3.0
"""Height over mean width."""
ROUNDS = 20
LEAST_RESIDUAL = 1e-3
"""Of the mean: rows that are nearer to the line count alike."""


def straightened(depth: Float[Tensor, "h w"]) -> Float[Tensor, "h w"]:
    """``depth``, above 0, with inverse depth linear in the row over each upright strip."""
    inverse = (1 / depth.detach().double()).cpu().numpy()
    result = inverse.copy()
    for strip in _strips(inverse):
        rows = np.nonzero(strip)[0]
        result[strip] = _line(rows, inverse[strip])[rows]
    return torch.from_numpy(1 / result).to(depth)


def _strips(inverse: Float[np.ndarray, "h w"]) -> Iterator[Bool[np.ndarray, "h w"]]:
    """Connected components that are high and narrow."""
    import cv2

    longer = max(inverse.shape)
    width_px = round(WIDTH_SHARE * longer) | 1  # Odd, so that no side of a wide surface is left
    beside = cv2.morphologyEx(inverse, cv2.MORPH_OPEN, np.ones((1, width_px)))
    nearer = (inverse > NEARER * beside).astype(np.uint8)
    count, component, statistics, _ = cv2.connectedComponentsWithStats(nearer, connectivity=8)
    for number in range(1, count):
        height, area = statistics[number, [cv2.CC_STAT_HEIGHT, cv2.CC_STAT_AREA]]
        is_narrow = height**2 >= LEAST_ELONGATION * area
        if is_narrow and height >= LEAST_HEIGHT_SHARE * longer:
            yield component == number


def _line(rows: np.ndarray, inverse: Float[np.ndarray, " n"]) -> Float[np.ndarray, " h"]:
    """Inverse depth of every row up to the last: least absolute distance from the rows' medians.

    Iteratively reweighted least squares (Weiszfeld).
    """
    at = np.unique(rows)
    medians = np.array([np.median(inverse[rows == row]) for row in at])
    terms = np.stack([np.ones(len(at)), at], 1)
    weight = np.ones(len(at))
    for _ in range(ROUNDS):
        line = np.linalg.lstsq(terms * weight[:, None], medians * weight, rcond=None)[0]
        distance = np.abs(medians - terms @ line)
        weight = np.maximum(distance, LEAST_RESIDUAL * medians.mean()) ** -0.5
    fitted = line[0] + line[1] * np.arange(rows.max() + 1)
    return np.maximum(fitted, medians.min() / 2)
