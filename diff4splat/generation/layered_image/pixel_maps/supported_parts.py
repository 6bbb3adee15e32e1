"""What carries a near part of a photograph, as shoulders carry a head (ours, ADR 55).

Axes: ``h w`` pixels. A part that is much nearer than all that is beneath it floats. Where colours
show a figure that holds the part and reaches the bottom of the image, the figure carries it, and
cannot be far behind it.
"""

import cv2
import numpy as np
import torch
from jaxtyping import Bool, Float, Int, UInt8
from torch import Tensor

from diff4splat.generation.layered_image.pixel_maps.floating_parts import (
    FloatingPart,
    largest_floating_part,
)

SIDES_SHARE = 3 / 4
"""Of a part's height, down to which what is beside it is background."""
LEAST_SLOPE = 1 / 40
"""How much lower the figure begins far from the part than beside it, of the image's height:
shoulders slope to both sides, and ground begins at one height."""
MOST_CUT, CUT_PX = 1 / 10, 2
"""Of the columns beside the part, in which the figure may begin so near to where background was
given: there it found no outline."""
COLOR_STEP, OUTLINE_SHARE = 0.2, 0.9
"""Least difference of colours, in [0, 1], across this share of the figure's outline."""
ROUNDS = 5


def with_support(depth: Float[Tensor, "h w"], rgb: Float[Tensor, "h w 3"]) -> Float[Tensor, "h w"]:
    """``depth``, above 0, with the figure that carries a floating part as near as the part."""
    inverse = (1 / depth.detach().double()).cpu().numpy()
    part = largest_floating_part(inverse)
    if part is None:
        return depth
    colors = (rgb.clamp(0, 1) * 255).round().byte().cpu().numpy()
    figure = _figure(part, colors)
    if not _carries(figure, part, colors):
        return depth
    nearer = np.where(figure, np.maximum(inverse, part.inverse), inverse)
    return torch.from_numpy(1 / nearer).to(depth)


def _figure(part: FloatingPart, colors: UInt8[np.ndarray, "h w 3"]) -> Bool[np.ndarray, "h w"]:
    """The part and what is of one piece with it, by colours (GrabCut, Rother et al. 2004)."""
    cv2.setRNGSeed(0)  # Its clusters start at random.
    labels, models = _trimap(part), (np.zeros((1, 65)), np.zeros((1, 65)))
    cv2.grabCut(colors, labels, None, *models, ROUNDS, cv2.GC_INIT_WITH_MASK)
    figure = np.isin(labels, (cv2.GC_FGD, cv2.GC_PR_FGD))
    _, component = cv2.connectedComponents(figure.astype(np.uint8), connectivity=4)
    figure = component == np.bincount(component[part.mask]).argmax()
    return _without_holes(figure)


def _trimap(part: FloatingPart) -> UInt8[np.ndarray, "h w"]:
    """The part is the figure, what is beside it is not, and what is beneath it may be."""
    labels = np.full(part.mask.shape, cv2.GC_PR_BGD, np.uint8)
    width = part.columns.stop - part.columns.start
    around = cv2.dilate(part.mask.astype(np.uint8), np.ones((2 * (width // 4) + 1,) * 2))
    sides = slice(0, _sides_end(part))
    labels[sides][around[sides] == 0] = cv2.GC_BGD
    labels[part.rows.stop :, part.columns] = cv2.GC_PR_FGD
    labels[(part.rows.stop + len(labels)) // 2 :, part.columns] = cv2.GC_FGD
    labels[part.mask] = cv2.GC_FGD
    return labels


def _without_holes(figure: Bool[np.ndarray, "h w"]) -> Bool[np.ndarray, "h w"]:
    """With all that the figure surrounds; what touches the image's border is outside."""
    _, component = cv2.connectedComponents((~figure).astype(np.uint8), connectivity=4)
    edges = (component[0], component[-1], component[:, 0], component[:, -1])
    return figure | ~np.isin(component, np.unique(np.concatenate(edges)))


def _carries(
    figure: Bool[np.ndarray, "h w"], part: FloatingPart, colors: UInt8[np.ndarray, "h w 3"]
) -> bool:
    """Whether the figure slopes on both sides of the part, and ends where colours do."""
    tops = _tops(figure, part)
    sides = tops[: part.columns.start][::-1], tops[part.columns.stop :]
    if min(map(_slope, sides)) < LEAST_SLOPE * len(figure):
        return False
    cut = np.abs(np.concatenate(sides) - _sides_end(part)) <= CUT_PX
    if cut.mean() > MOST_CUT:
        return False
    return _outline_step(figure, part.middle, colors) >= COLOR_STEP


def _tops(figure: Bool[np.ndarray, "h w"], part: FloatingPart) -> Int[np.ndarray, " w"]:
    """In every column the first row of the figure from the middle of the part down."""
    beneath = figure[part.middle :]
    return part.middle + np.where(beneath.any(0), beneath.argmax(0), len(beneath))


def _slope(tops: Int[np.ndarray, " n"]) -> float:
    """How many rows lower the far half begins than the near one."""
    near, far = np.array_split(tops, 2)
    return float(np.median(far) - np.median(near)) if len(far) else 0.0


def _outline_step(
    figure: Bool[np.ndarray, "h w"], top: int, colors: UInt8[np.ndarray, "h w 3"]
) -> float:
    """Difference of colours that most of the outline below ``top`` has."""
    outline = figure & (cv2.erode(figure.astype(np.uint8), np.ones((3, 3)), borderValue=1) == 0)
    around = np.ones((5, 5))
    step = (cv2.dilate(colors, around) - cv2.erode(colors, around)).max(-1) / 255
    below = step[top:][outline[top:]]
    return float(np.quantile(below, 1 - OUTLINE_SHARE)) if len(below) else 0.0


def _sides_end(part: FloatingPart) -> int:
    """The row down to which what is beside the part is background."""
    return part.rows.start + round(SIDES_SHARE * (part.rows.stop - part.rows.start))
