"""Displacement that belongs to a larger copy of a photograph, on every grid that layers need.

Axes: ``t`` latent frames, ``h w`` pixels of the copy that other networks see, ``y x`` of the copy
that the motion prior sees.
"""

from dataclasses import replace

from jaxtyping import Bool, Float
from torch import Tensor
from torch.nn.functional import avg_pool2d

from diff4splat.generation.inputs.input_image import InputImage
from diff4splat.generation.layered_image.pixel_maps.image_maps import FineMaps, ImageMaps
from diff4splat.generation.layered_image.pixel_maps.upsampling import upsample_maps


def depth_at(maps: ImageMaps, small: InputImage, image: InputImage) -> Float[Tensor, "y x"]:
    """Depth of the copy ``image``, from the maps of ``small`` or of the larger copy they have."""
    fine = maps.fine
    if fine is not None and fine.depth.shape == image.rgb.shape[:2]:
        return fine.depth
    return upsample_maps(maps.depth, None, (small.rgb, image.rgb))[0]


def with_displacement(
    maps: ImageMaps,
    image: InputImage,
    depth: Float[Tensor, "y x"],
    displacement: Float[Tensor, "t y x 3"],
) -> ImageMaps:
    """``maps`` whose pixels move as the copy ``image`` does; ``depth`` is that of the copy."""
    if displacement.shape[1:3] == maps.depth.shape:
        return replace(maps, depth=depth, displacement=displacement)
    fine = maps.fine or FineMaps(rgb=image.rgb, depth=depth)
    if fine.depth.shape == depth.shape:
        fine = replace(fine, depth=depth)
    at_fine_depth, at_fine = upsample_maps(depth, displacement, (image.rgb, fine.rgb))
    at_fine = at_fine * (fine.depth / at_fine_depth)[..., None]
    small = reduced_displacement(displacement, depth, maps.depth)
    return replace(maps, displacement=small, fine=replace(fine, displacement=at_fine))


def with_majority_displacement(
    maps: ImageMaps, depth: Float[Tensor, "y x"], displacement: Float[Tensor, "t y x 3"]
) -> ImageMaps:
    """``maps`` whose pixels move as most of their pixels do in an enlarged copy of that depth."""
    found = reduced_displacement(displacement, depth, maps.depth, least_share=0.5)
    return replace(maps, displacement=found) if found.any() else maps


def reduced_displacement(
    displacement: Float[Tensor, "t y x 3"],
    depth: Float[Tensor, "y x"],
    small_depth: Float[Tensor, "h w"],
    least_share: float = 0.0,
) -> Float[Tensor, "t h w 3"]:
    """Of a smaller copy: a cell moves, as far in the image, as those of its pixels that move.

    It is static where less than ``least_share`` of them move.
    """
    factor = depth.shape[0] // small_depth.shape[0]
    relative = (displacement / depth[..., None]).movedim(-1, 1)
    means, share = mean_of_moving(relative, displacement.any(-1).any(0), factor)
    return (means * (share >= least_share)).movedim(1, -1) * small_depth[..., None]


def mean_of_moving(
    values: Float[Tensor, "t c y x"], moving: Bool[Tensor, "y x"], factor: int
) -> tuple[Float[Tensor, "t c h w"], Float[Tensor, "h w"]]:
    """Mean over the moving pixels of every cell, 0 where none moves, and the share that does."""
    share = avg_pool2d(moving.to(values)[None], factor)[0]
    return avg_pool2d(values * moving, factor) / share.clamp_min(0.5 / factor**2), share
