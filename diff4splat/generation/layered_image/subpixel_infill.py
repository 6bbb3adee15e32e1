"""What a picture shows between its pixels: Gaussians half a pixel from each other (ours).

Axes: ``h w`` pixels of a picture, ``q`` = (2 h − 1) (2 w − 1) − h w
places between them, ``n`` Gaussians before. Seen from elsewhere, pixels of one surface come to lie
between those of the new picture, where small Gaussians leave gaps and large ones blur. The places
between them are filled by cubic interpolation of colour and linear interpolation of inverse depth,
in which planes are planes; across an edge of depth that spans a thin sheet, which hides less than a
gap would.
"""

from dataclasses import replace

import torch
from jaxtyping import Float, Int
from torch import Tensor

from diff4splat.generation.input_image import InputImage
from diff4splat.generation.keyframe_gaussians import PIXEL_FOOTPRINT_PX
from diff4splat.generation.layered_image.guided_upsampling import UpsampledScene, transfer_motion
from diff4splat.geometry.camera import Camera, project, stack_cameras
from diff4splat.geometry.depth import distance_from_depth
from diff4splat.models.config.networks import GAUSSIAN_SPLIT, ActivationConfig
from diff4splat.models.ldrm.gaussian_head import PixelBase, activate
from diff4splat.models.ldrm.plane_prior import OPAQUE
from diff4splat.scene.gaussians import Gaussians, concatenate

_WHOLE = 0.999
"""Of what a place is made of, but for rounding."""


def add_subpixel_gaussians(scene: UpsampledScene, picture: InputImage) -> UpsampledScene:
    """The scene of one picture, with Gaussians between those of its pixels behind all others.

    Each moves as the pixel nearest to it. Beside pixels that were pruned there are none.
    """
    means, known = scene.gaussians.means, scene.cells[: scene.pixels]
    depth = project(picture.camera, means[: scene.pixels])[1]
    own = depth.new_full((picture.rgb[..., 0].numel(),), torch.nan)
    own = own.index_copy(0, known, depth).view(picture.camera.size_px)
    lattice_depth = _lattice_depth(own)
    places, cells = _places(lattice_depth, own)
    every = torch.arange(len(means), device=means.device)
    row = known.new_zeros(own.numel()).index_copy(0, known, every[: scene.pixels])
    grown = lattice_depth.flatten()[places] / own.flatten()[cells]
    grown = torch.cat([torch.ones_like(means[:, 0]), grown])
    return replace(
        scene,
        gaussians=concatenate([scene.gaussians, _lattice(picture, lattice_depth, places)]),
        motion=transfer_motion(scene.motion, torch.cat([every, row[cells]]), grown),
        cells=torch.cat([scene.cells, torch.full_like(cells, own.numel())]),
    )


def _lattice_depth(own: Float[Tensor, "h w"]) -> Float[Tensor, "hh ww"]:
    """Depth on the lattice; NaN where a pixel that it is made of is unknown."""
    known = own.isfinite()
    inverse, share = _spread(torch.stack([(1 / own).where(known, 0), known.to(own)]), "bilinear")
    return (1 / inverse).where(share > _WHOLE, torch.nan)


def _places(
    lattice_depth: Float[Tensor, "hh ww"], own: Float[Tensor, "h w"]
) -> tuple[Int[Tensor, " q"], Int[Tensor, " q"]]:
    """Which places of the lattice lie between known pixels, and the nearest pixel of each."""
    row, column = torch.meshgrid(
        *(torch.arange(size, device=own.device) for size in lattice_depth.shape), indexing="ij"
    )
    nearest = (row + 1) // 2 * own.shape[1] + (column + 1) // 2
    between = ((row % 2 == 1) | (column % 2 == 1)) & lattice_depth.isfinite()
    return between.flatten().nonzero()[:, 0], nearest[between]


def _lattice(
    picture: InputImage, depth: Float[Tensor, "hh ww"], places: Int[Tensor, " q"]
) -> Gaussians:
    """Opaque Gaussians of a picture's colours at the places."""
    cameras = stack_cameras([lattice_camera(picture.camera)])
    rgb = _spread(picture.rgb.movedim(-1, 0), "bicubic").clamp(0, 1)
    known = depth.nan_to_num(1.0)[None]
    base = PixelBase(
        rgb=rgb.movedim(0, -1)[None],
        distance=distance_from_depth(cameras, known),
        opacity=torch.full_like(known, OPAQUE),
        cameras=cameras,
    )
    fresh = known.new_zeros(sum(GAUSSIAN_SPLIT), *known.shape)
    footprint = ActivationConfig(footprint_px=2 * PIXEL_FOOTPRINT_PX)
    return activate(fresh, base, footprint).select(places)


def lattice_camera(camera: Camera) -> Camera:
    """The view whose pixel centres are those of ``camera`` and the places half way between."""
    height, width = camera.size_px
    twice = camera.resized((2 * height, 2 * width))
    return replace(twice, center_px=twice.center_px - 0.5, size_px=(2 * height - 1, 2 * width - 1))


def _spread(maps: Float[Tensor, "c h w"], mode: str) -> Float[Tensor, "c hh ww"]:
    """Maps of pixels on the lattice."""
    size = [2 * side - 1 for side in maps.shape[1:]]
    return torch.nn.functional.interpolate(maps[None], size, mode=mode, align_corners=True)[0]
