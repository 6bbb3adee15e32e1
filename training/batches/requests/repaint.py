"""Objects in other colours, and objects of two colours.

Worlds have few pairs of noun and colour, and few objects of several colours; a network that learns
from them alone takes the part of one colour for the object. Shading stays: a pixel keeps its
luminance, as a share of the mean of what is painted. Axes: ``h w`` pixels.
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

REPAINTED_SHARE, TWO_COLORED_SHARE = 0.25, 0.25
"""Shares of objects that get another colour, and a second one."""
PART_SHARES = (0.1, 0.45)
"""Of the object that the second colour covers: less than half, so that the first names it."""
EXPOSURES = (0.6, 1.2)
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
LEAST_LUMINANCE = 0.01
LARGEST_SHADE = 2.5


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
        _paint(image, one.mask, named.color, generator)
    if part < TWO_COLORED_SHARE:
        second = draw(colors_unlike([named.color]), generator)
        _paint(image, _random_part(one, generator), second, generator)
    return replace(one, named=named)


def _paint(
    image: UInt8[Tensor, "h w 3"],
    mask: Bool[Tensor, "h w"],
    color: str,
    generator: torch.Generator,
) -> None:
    """Give the pixels of ``mask`` a colour of this name, in place."""
    least, most = EXPOSURES
    exposure = least + (most - least) * float(torch.rand((), generator=generator))
    pixels = linear_from_srgb(image[mask].numpy() / 255)
    painted = exposure * _shade(pixels) * draw(color_anchors(color), generator)
    srgb = np.rint(255 * srgb_from_linear(painted.clip(0, 1)))
    image[mask] = torch.from_numpy(srgb.astype(np.uint8))


def _shade(pixels: Float64[np.ndarray, "n 3"]) -> Float64[np.ndarray, "n 1"]:
    """Luminance of every pixel over the mean."""
    luminance = pixels @ LUMINANCE + LEAST_LUMINANCE
    return (luminance / luminance.mean()).clip(0, LARGEST_SHADE)[:, None]


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
