"""Colours where nothing of a photograph is known, by the image inpainting network (ADR 50).

Axes: ``h w`` pixels.

    image, mask ─ copy of at most 512 px ─ unknown margin, to whole cells ─ network ─ cut, enlarged
"""

from collections.abc import Callable
from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor
from torch.nn.functional import interpolate, pad

from diff4splat.generation.layered_image.other_grid import copy_size
from diff4splat.generation.one_thread import one_thread
from diff4splat.models.protocols import ImageCompletion

Inpaint = Callable[[Float[Tensor, "h w 3"], Bool[Tensor, "h w"]], Float[Tensor, "h w 3"]]
"""From colours, and where they are known, to colours everywhere."""
MOST_SIDE_PX = 512
"""The network was trained on such images; larger ones take longer and have the same detail."""

GREY = 2 / 255
"""Difference of a pixel's channels up to which it has no colour."""


@dataclass(frozen=True, slots=True, kw_only=True)
class NetworkInpainting:
    """An ``Inpaint`` by a network that takes sides of some multiple."""

    network: ImageCompletion

    @torch.no_grad()
    def __call__(
        self, rgb: Float[Tensor, "h w 3"], known: Bool[Tensor, "h w"]
    ) -> Float[Tensor, "h w 3"]:
        """``rgb`` where it is ``known``; values in [0, 1] elsewhere."""
        if bool(known.all()):
            return rgb
        image = torch.where(known[..., None], rgb, 0.0).movedim(-1, 0)[None]
        small, mask = _reduced(image, known, MOST_SIDE_PX)
        found = interpolate(self._completed(small, mask), known.shape, mode="bilinear")
        if _is_grey(rgb[known]):
            found = found.mean(1, keepdim=True).expand_as(found)
        return torch.where(known[..., None], rgb, found[0].movedim(0, -1))

    def _completed(
        self, image: Float[Tensor, "1 3 h w"], known: Bool[Tensor, "1 h w"]
    ) -> Float[Tensor, "1 3 h w"]:
        """With an unknown margin on both sides, which is cut again."""
        height, width = known.shape[1:]
        down, across = (-side % self.network.multiple_px for side in (height, width))
        top, left = down // 2, across // 2
        margins = (left, across - left, top, down - top)
        with one_thread():
            found = self.network(pad(image, margins), pad(known, margins))
        return found[..., top : top + height, left : left + width]


def _is_grey(rgb: Float[Tensor, "n 3"]) -> bool:
    """A photograph without colours stays one; the network knows hardly any, and adds some."""
    return bool((rgb.amax(-1) - rgb.amin(-1) < GREY).all())


def on_copy(inpaint: Inpaint, most_side_px: int) -> Inpaint:
    """The same on a copy of at most ``most_side_px``, in a fraction of the time."""

    def inpaint_copy(
        rgb: Float[Tensor, "h w 3"], known: Bool[Tensor, "h w"]
    ) -> Float[Tensor, "h w 3"]:
        if max(known.shape) <= most_side_px:
            return inpaint(rgb, known)
        image, mask = _reduced(rgb.movedim(-1, 0)[None], known, most_side_px)
        small = inpaint(image[0].movedim(0, -1), mask[0]).movedim(-1, 0)[None]
        found = interpolate(small, known.shape, mode="bilinear")[0].movedim(0, -1)
        return torch.where(known[..., None], rgb, found)

    return inpaint_copy


def _reduced(
    image: Float[Tensor, "1 3 h w"], known: Bool[Tensor, "h w"], most_side_px: int
) -> tuple[Float[Tensor, "1 3 hs ws"], Bool[Tensor, "1 hs ws"]]:
    """A copy, known where all of its pixels are."""
    size = copy_size((known.shape[0], known.shape[1]), most_side_px)
    if known.shape == size:
        return image, known[None]
    share = interpolate(known[None, None].to(image), size, mode="area")
    return interpolate(image, size, mode="area"), share[:, 0] > 1 - 1e-4
