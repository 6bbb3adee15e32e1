"""Key frames of a fill: those that together see most of what the image hides."""

import torch
from image_layers import input_image, random_rgb, sliding_path

from diff4splat.generation.layered_image.build import build_layered_image
from diff4splat.generation.layered_image.pixel_maps.image_maps import ImageMaps
from diff4splat.generation.layered_image.types import LayeredImage
from diff4splat.generation.video.fill_path import fill_path
from diff4splat.paths.camera_path import CameraPath

SIDE_PX, DEPTH = 32, 6.0


def layered() -> LayeredImage:
    image = input_image(random_rgb(SIDE_PX, SIDE_PX), 30.0)
    maps = ImageMaps(depth=torch.full((SIDE_PX, SIDE_PX), DEPTH), displacement=None)
    return build_layered_image(image, image, maps, 2)


def swing(frames: int, reach: float) -> CameraPath:
    """To the right, back, to the left, and back."""
    path = sliding_path(layered().layers[0].camera, frames, (1.0, 0.0, 0.0))
    place = reach * torch.sin(2 * torch.pi * torch.linspace(0, 1, frames))
    path.cameras.world_from_camera[:, 0, 3] = place
    return path


def test_a_swing_is_filled_at_both_ends() -> None:
    chosen = fill_path(layered(), swing(9, 2.0))
    side = chosen.cameras.position[:, 0]
    assert len(chosen) == 9 and float(side[0]) == 0
    torch.testing.assert_close(side[[4, 8]], torch.tensor([2.0, -2.0]), rtol=0.02, atol=0.02)
    assert bool((chosen.times_s.diff() > 0).all())


def test_the_second_key_frame_sees_what_the_first_does_not() -> None:
    path = swing(9, 2.0)
    path.cameras.world_from_camera[5:, 0, 3] *= 0.5
    side = fill_path(layered(), path).cameras.position[:, 0]
    assert float(side[4]) > 1.9, "most is hidden there"
    assert -1.05 < float(side[8]) < -0.9, "less, but nothing of it is known"


def test_a_path_that_hides_nothing_has_no_key_frames() -> None:
    assert fill_path(layered(), swing(9, 0.0)) is None


def test_a_straight_path_ends_where_it_ends() -> None:
    camera = layered().layers[0].camera
    path = sliding_path(camera, 9, (0.3, 0.0, 0.0))
    chosen = fill_path(layered(), path)
    torch.testing.assert_close(chosen.cameras.position[-1], path.cameras.position[-1])
    torch.testing.assert_close(chosen.times_s[-1], path.times_s[-1])
