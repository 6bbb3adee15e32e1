"""Simulated relative disparity and reference depth. Axes: ``t`` frames, ``h w`` pixels.

Depth is log-normal and smooth (indoor around 3 m, outdoor around 12 m). Disparity is
(1/z · noise − shift) / scale with 6 % noise in it and 6 % in the reference, in blobs of several
pixels. Sky has hardly any disparity but a finite reference, as MegaSaM gives it, both smooth.
Objects that move have a reference that is wrong by one factor each, as triangulation across time
gives them.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float32

SHAPE = (8, 90, 160)
NOISE = 0.06
SCALE = 0.013
MIDDLE_M, SPREAD = {"indoor": 3.0, "outdoor": 12.0}, {"indoor": 0.5, "outdoor": 0.8}
_WRONG = (0.35, 0.7)
"""How much nearer the reference puts what moves, a range of factors."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Scene:
    """One clip."""

    disparity: Float32[np.ndarray, "t h w"]
    reference: Float32[np.ndarray, "t h w"]
    depth: Float32[np.ndarray, "t h w"]
    """The truth."""
    contaminated: Bool[np.ndarray, "t h w"]


def make_scene(
    kind: str, sky: float, moving: float, shift_share: float, seed: int, haze: float = 0.02
) -> Scene:
    """``shift_share`` is the shift over the median of 1/z, ``haze`` sky over median disparity."""
    random = np.random.default_rng(seed)
    depth = MIDDLE_M[kind] * np.exp(SPREAD[kind] * _smooth(random))
    shift = shift_share * float(np.median(1 / depth))
    inverse = np.exp(NOISE * _noise(random)) / depth
    disparity = np.maximum(inverse - shift, 0) / SCALE
    reference = depth * np.exp(NOISE * _noise(random))
    is_sky = np.zeros(SHAPE, bool)
    is_sky[:, : round(sky * SHAPE[1])] = True
    clouds = _noise(random)[is_sky]
    disparity[is_sky] = haze * np.exp(0.2 * clouds) * np.median(disparity)
    reference[is_sky] = random.uniform(25, 60) * np.exp(0.1 * clouds)
    moves = _objects(random, moving, is_sky)
    for number in range(1, int(moves.max()) + 1):
        reference[moves == number] *= random.uniform(*_WRONG)
    return Scene(
        disparity=disparity.astype(np.float32),
        reference=reference.astype(np.float32),
        depth=depth.astype(np.float32),
        contaminated=is_sky | (moves > 0),
    )


def _smooth(random: np.random.Generator) -> np.ndarray:
    """Standard normal values that change slowly over the image, and hardly over time."""
    coarse = random.standard_normal((6, 9)).astype(np.float32)
    field = cv2.resize(coarse, SHAPE[:0:-1], interpolation=cv2.INTER_CUBIC)
    field = (field - field.mean()) / field.std()
    drift = np.linspace(0, 0.05, SHAPE[0])[:, None, None]
    return field[None] + drift


def _noise(random: np.random.Generator) -> np.ndarray:
    """Standard normal values in blobs of about six pixels, other ones in every frame."""
    rows, columns = SHAPE[1] // 6, SHAPE[2] // 6
    coarse = random.standard_normal((SHAPE[0], rows, columns)).astype(np.float32)
    fine = [cv2.resize(each, SHAPE[:0:-1], interpolation=cv2.INTER_CUBIC) for each in coarse]
    return np.stack(fine) / np.std(fine)


def _objects(random: np.random.Generator, share: float, is_sky: np.ndarray) -> np.ndarray:
    """Numbers of two objects that together cover ``share`` of the image, below the sky."""
    number = np.zeros(SHAPE, np.int64)
    if not share:
        return number
    top = int(is_sky[0].any(1).sum())
    height = SHAPE[1] - top
    width = round(share * SHAPE[1] * SHAPE[2] / (2 * height))
    left = random.integers(0, SHAPE[2] - 2 * width - 2)
    number[:, top:, left : left + width] = 1
    number[:, top:, left + width + 2 : left + 2 * width + 2] = 2
    return number
