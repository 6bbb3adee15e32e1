"""The layer of an image's own pixels."""

import torch
from image_layers import GREEN, RED
from torch.nn.functional import interpolate

from diff4splat.generation.inputs.input_image import InputImage, downsample
from diff4splat.generation.layered_image.pixel_maps.image_maps import ImageMaps
from diff4splat.generation.layered_image.pixel_maps.pixel_layer import pixel_layer
from diff4splat.geometry.camera import pinhole

SIDE_PX = 64


def test_mixed_pixels_of_the_photograph_move_with_the_object() -> None:
    share = torch.zeros(SIDE_PX, SIDE_PX)
    share[16:40, 16:40] = 1.0
    share[15, 16:40] = share[40, 16:40] = share[16:40, 15] = share[16:40, 40] = 0.3
    rgb = share[..., None] * RED + (1 - share[..., None]) * GREEN
    image = InputImage(rgb=rgb, camera=pinhole(64.0, (SIDE_PX, SIDE_PX)), focal_source="")
    small = downsample(image, 4)
    mask = interpolate((share == 1).float()[None, None], (16, 16), mode="area")[0, 0] == 1
    displacement = torch.zeros(2, 16, 16, 3)
    displacement[1, mask] = torch.tensor([1.0, 0.0, 0.0])
    maps = ImageMaps(depth=torch.where(mask, 3.0, 20.0), displacement=displacement)
    layer = pixel_layer(small, image, maps)
    moved = layer.displacement[1, ..., 0] > 0.5
    assert bool(moved[20:36, 20:36].all()) and bool(moved[(share == 0.3)].all())
    assert not bool(moved[:12].any())
