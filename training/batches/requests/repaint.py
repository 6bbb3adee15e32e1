"""Objects in other colours, and objects of two colours.

Worlds have few pairs of noun and colour, and few objects of several colours; a network that learns
from them alone takes the part of one colour for the object. Light, shade and texture stay: linear
pixels are multiplied by the new colour over the old one. Axes: ``h w`` pixels.
"""

from dataclasses import replace

import numpy as np
import torch
from jaxtyping import Bool, Float64, UInt8
from torch import Tensor

from diff4splat.captions.colors import COLOR_NAMES, color_anchors
from diff4splat.captions.random_draws import draw
from diff4splat.captions.requests import colors_unlike
from diff4splat.captions.srgb import linear_from_srgb, srgb_from_linear
from diff4splat.training.batches.requests.object_image import ObjectImage
from diff4splat.training.batches.requests.present import PresentObject

REPAINTED_SHARE, TWO_COLORED_SHARE = 0.15, 0.2
"""Shares of objects that get another colour, and a second one."""
PART_SHARES = (0.1, 0.45)
"""Of the object that the second colour covers: less than half, so that the first names it."""
LARGEST_GAIN = 12.0
"""Black cannot become white without its noise."""


def repaint(original: ObjectImage, generator: torch.Generator) -> ObjectImage:
    """The same image; some of its objects have another colour, some a second one."""
    image = original.image.clone()
    objects = [_repaint_object(image, one, generator) for one in original.objects]
    return ObjectImage(image=image, objects=objects)


def _repaint_object(
    image: UInt8[Tensor, "h w 3"], one: PresentObject, generator: torch.Generator
) -> PresentObject:
    """Its new name; its pixels are painted in place."""
    named = one.named
    whole, part = torch.rand(2, generator=generator).tolist()
    if whole < REPAINTED_SHARE:
        named = replace(named, color=draw(COLOR_NAMES, generator))
        _paint(image, one.mask, one.named.color, draw(color_anchors(named.color), generator))
    if part < TWO_COLORED_SHARE:
        second = draw(color_anchors(draw(colors_unlike([named.color]), generator)), generator)
        _paint(image, _random_part(one, generator), named.color, second)
    return replace(one, named=named)


def _paint(
    image: UInt8[Tensor, "h w 3"],
    mask: Bool[Tensor, "h w"],
    before: str,
    after: Float64[np.ndarray, "3"],
) -> None:
    """Turn the pixels of ``mask`` from a colour called ``before`` to a linear one, in place."""
    gain = (after / np.mean(color_anchors(before), 0)).clip(0, LARGEST_GAIN)
    painted = (gain * linear_from_srgb(image[mask].numpy() / 255)).clip(0, 1)
    image[mask] = torch.from_numpy(np.rint(255 * srgb_from_linear(painted)).astype(np.uint8))


def _random_part(one: PresentObject, generator: torch.Generator) -> Bool[Tensor, "h w"]:
    """One side of the object, a band through it, or a disc."""
    y, x = one.mask.nonzero(as_tuple=True)
    pixels = torch.stack([x, y], 1).double()
    center = pixels[int(torch.randint(len(pixels), (), generator=generator))]
    angle = 2 * torch.pi * torch.rand((), generator=generator, dtype=torch.float64)
    along = (pixels - center) @ torch.stack([angle.cos(), angle.sin()])
    order = draw((along, along.abs(), (pixels - center).norm(dim=1)), generator)
    least, most = PART_SHARES
    share = least + (most - least) * float(torch.rand((), generator=generator))
    part = torch.zeros_like(one.mask)
    part[y, x] = order <= order.quantile(share)
    return part
