"""What is seen where something went: what stands behind the picture, without that thing (ours).

Axes: ``h w`` pixels of the picture that networks see, ``n`` Gaussians. What stands behind continues
the picture backwards, so behind a thing it has the colours of that thing, which stay as a blur when
it goes. There it takes the colours of what stands around; where it lies does not change.
"""

from dataclasses import replace

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.generation.input_image import InputImage
from diff4splat.generation.reconstruction import Canonical
from diff4splat.geometry.camera import project
from diff4splat.scene.harmonics import dc_from_color

GROWN_PX = 2
"""Around what goes, where it is mixed with what stands."""


def inpaint_disoccluded(
    canonical: Canonical, moving: Bool[Tensor, "h w"], picture: InputImage
) -> Canonical:
    """The scene with what stands behind the ``moving`` coloured like what stands around it."""
    stands = ~_grown(moving)
    if bool(stands.all()) or not bool(stands.any()):
        return canonical
    standing = (canonical.every_cell == canonical.maps.gaussians[0, 0].numel()).nonzero()[:, 0]
    gaussians, (height, width) = canonical.gaussians, moving.shape
    pixels, depth = project(picture.camera, gaussians.means[standing])
    column, row = pixels.nan_to_num(-1).clamp(-1, max(height, width)).floor().long().unbind(-1)
    inside = (depth > 0) & (column >= 0) & (column < width) & (row >= 0) & (row < height)
    column, row = column.clamp(0, width - 1), row.clamp(0, height - 1)
    behind = (inside & ~stands[row, column]).nonzero()[:, 0]
    colors = fill_from_neighbours(picture.rgb, stands)[row[behind], column[behind]]
    sh = gaussians.sh.clone()
    sh[standing[behind]] = 0
    sh[standing[behind], 0] = dc_from_color(colors).to(sh)
    return replace(canonical, gaussians=replace(gaussians, sh=sh))


def fill_from_neighbours(
    rgb: Float[Tensor, "h w 3"], known: Bool[Tensor, "h w"]
) -> Float[Tensor, "h w 3"]:
    """``rgb`` where it is ``known``, at least somewhere; else the mean of the smallest window."""
    share = known.to(rgb)[None]
    maps = torch.cat([rgb.movedim(-1, 0) * share, share])[None]
    found, have, side = rgb, known, 3
    while not bool(have.all()):
        mean = torch.nn.functional.avg_pool2d(maps, side, 1, side // 2, count_include_pad=False)[0]
        fresh = (mean[3] > 0) & ~have
        color = (mean[:3] / mean[3].where(fresh, 1)).movedim(0, -1)
        found, have = torch.where(fresh[..., None], color, found), have | fresh
        side = 2 * side + 1
    return found


def _grown(mask: Bool[Tensor, "h w"]) -> Bool[Tensor, "h w"]:
    side = 2 * GROWN_PX + 1
    return torch.nn.functional.max_pool2d(mask.float()[None, None], side, 1, GROWN_PX)[0, 0] > 0
