"""How much darker an object makes the pixels of an image, by the object shadow network.

Axes: ``h w`` pixels of the image, ``y x`` of the copy that the mask belongs to.

    image, mask ─ copies ─ network ─ surroundings ─ enlarged, edges of the image ─ darkening
"""

import torch
from jaxtyping import Bool, Float
from torch import Tensor
from torch.nn.functional import interpolate

from diff4splat.generation.layered_image.mask_rim import nearest_inside
from diff4splat.generation.layered_image.rigid_components import connected_components
from diff4splat.generation.layered_image.windows import mean_around
from diff4splat.models.image_unet.cells import MULTIPLE_PX
from diff4splat.models.protocols import ShadowOfObject

SIDE_PX = 128
"""Of the longer side of the copy that the network sees (chosen in docs/log/object-shadow.md)."""
LEAST_DARKENING, LEAST_PEAK = 0.07, 0.15
"""Below the first a pixel is as bright as without the object; a shadow reaches the second."""
MOST_DARKENING = 0.8
"""Beyond it a wrong prediction makes dark things glow, and a right one leaves a faint trace."""
SURROUNDINGS_SHARE, LEAST_LIT = 0.1, 0.02
"""Of the copy's longer side: how far surroundings reach; least share of them that must be lit."""
GUIDE_PX, GUIDE_VARIANCE = 2, 4e-3
"""Of the guided filter: half of its window in the copy, and the variance that is texture."""
LEAST_COLOR = 1 / 255


@torch.no_grad()
def predicted_darkening(
    network: ShadowOfObject, rgb: Float[Tensor, "h w 3"], mask: Bool[Tensor, "y x"]
) -> Float[Tensor, "h w 3"]:
    """Of every pixel, nowhere more than turns it white; on the object, that of its outline.

    A mask is not exact: what does not move of it is ground in the shadow.
    """
    image, share = rgb.movedim(-1, 0), mask.to(rgb)[None, None]
    darkening = _by_network(network, image, share).movedim(0, -1)
    beside = _resized(share, rgb.shape[:2])[0, 0] <= 0
    if bool(beside.any()):
        darkening = darkening.flatten(0, 1)[nearest_inside(beside)]
    darkening = torch.minimum(darkening.clamp_min(0), -rgb.clamp_min(LEAST_COLOR).log())
    return torch.where(is_shadow(darkening)[..., None], darkening, 0.0)


def is_shadow(darkening: Float[Tensor, "h w 3"]) -> Bool[Tensor, "h w"]:
    """Connected pixels that are darkened, some of them clearly (hysteresis, Canny 1986)."""
    strongest = darkening.amax(-1)
    component = connected_components(strongest > LEAST_DARKENING)
    peak = strongest.new_zeros(int(component.max()) + 1)
    peak = peak.scatter_reduce(0, component.flatten(), strongest.flatten(), "amax")
    return (component > 0) & (peak >= LEAST_PEAK)[component]


def _by_network(
    network: ShadowOfObject, image: Float[Tensor, "3 h w"], share: Float[Tensor, "1 1 y x"]
) -> Float[Tensor, "3 h w"]:
    """On a copy of the size that the network was trained on, enlarged or reduced again."""
    size_px = _network_size(image.shape[1:])
    copy, mask = _resized(image[None], size_px)[0], _resized(share, size_px)[0]
    found = network(copy[None], mask)[0].to(image).clamp(0, MOST_DARKENING)
    found = no_brighter_than_around(found, copy, mask[0])
    if max(size_px) < max(image.shape[1:]):
        return enlarged_along(found, _log_brightness(copy), _log_brightness(image))
    return _resized(found[None], image.shape[1:])[0]


def no_brighter_than_around(
    darkening: Float[Tensor, "c y x"], rgb: Float[Tensor, "3 y x"], mask: Float[Tensor, "y x"]
) -> Float[Tensor, "c y x"]:
    """Less of it where a pixel without the shadow would be brighter than lit pixels around it.

    A prediction goes a little beyond the edge of a shadow: there the ground would shine.
    """
    shadow, brightness = darkening.mean(0), _log_brightness(rgb)
    reach_px = round(SURROUNDINGS_SHARE * max(shadow.shape))
    lit = ((shadow < LEAST_DARKENING) & (mask < 0.5)).to(rgb)
    share = mean_around(lit, reach_px)
    around = mean_around(lit * brightness, reach_px) / share.clamp_min(LEAST_LIT)
    most = (around - mean_around(brightness, 1)).clamp_min(0)
    part = torch.where(share > LEAST_LIT, most / shadow.clamp_min(1e-6), 1.0)
    return darkening * part.clamp_max(1)


def enlarged_along(
    maps: Float[Tensor, "c y x"], guide: Float[Tensor, "y x"], fine_guide: Float[Tensor, "h w"]
) -> Float[Tensor, "c h w"]:
    """Maps of a copy at the size of the image, with its edges (fast guided filter, He 2015).

    Where a surface of one colour comes out of a shadow, darkening is the log colour but for a sign.
    """
    mean_guide = mean_around(guide, GUIDE_PX)
    variance = mean_around(guide * guide, GUIDE_PX) - mean_guide.square()
    lines = []
    for values in maps:
        mean = mean_around(values, GUIDE_PX)
        covariance = mean_around(values * guide, GUIDE_PX) - mean * mean_guide
        slope = covariance / (variance + GUIDE_VARIANCE)
        offset = mean - slope * mean_guide
        lines += [mean_around(slope, GUIDE_PX), mean_around(offset, GUIDE_PX)]
    fine = interpolate(torch.stack(lines)[None], fine_guide.shape, mode="bilinear")[0]
    return fine[::2] * fine_guide + fine[1::2]


def _log_brightness(rgb: Float[Tensor, "3 y x"]) -> Float[Tensor, "y x"]:
    return rgb.mean(0).clamp_min(LEAST_COLOR).log()


def _network_size(size_px: torch.Size) -> tuple[int, int]:
    scale = SIDE_PX / max(size_px)
    height, width = (max(round(side * scale / MULTIPLE_PX), 1) * MULTIPLE_PX for side in size_px)
    return height, width


def _resized(maps: Float[Tensor, "b c y x"], size_px: torch.Size | tuple[int, int]) -> Tensor:
    """Means of smaller pixels, or interpolated."""
    shrinks = max(size_px) < max(maps.shape[2:])
    return interpolate(maps, tuple(size_px), mode="area" if shrinks else "bilinear")
