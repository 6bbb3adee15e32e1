"""The network that tells the depth of one picture."""

from dataclasses import replace

import pytest
import torch
from torch import Tensor

from diff4splat.geometry.camera import Camera
from diff4splat.models.config.model import DetailConfig
from diff4splat.models.config.sizes import test_size as tiny_size
from diff4splat.models.ldrm.refinement.branch import RefinementBranch
from diff4splat.models.ldrm.refinement.posed_video import PosedVideo
from diff4splat.models.monocular_depth.network import MULTIPLE_PX, MonocularDepthNet

DETAIL = DetailConfig(width=6, match_channels=4, depths=4, surroundings=4, picture_width=4)
MODEL = replace(tiny_size(), detail=DETAIL)
SIDE = 32


def network() -> MonocularDepthNet:
    torch.manual_seed(0)
    made = MonocularDepthNet(4)
    torch.nn.init.normal_(made.head.weight, std=0.1)
    return made


def sight(frames: int) -> PosedVideo:
    torch.manual_seed(1)
    cameras = Camera(
        focal_px=torch.full((1, frames, 2), 30.0),
        center_px=torch.full((1, frames, 2), SIDE / 2),
        world_from_camera=torch.eye(4).repeat(1, frames, 1, 1),
        size_px=(SIDE, SIDE),
    )
    return PosedVideo(rgb=torch.rand(1, 3, frames, SIDE, SIDE), cameras=cameras)


def branch() -> RefinementBranch:
    torch.manual_seed(2)
    made = RefinementBranch(MODEL)
    torch.nn.init.normal_(made.pixels.distance.weight, std=0.1)
    torch.nn.init.normal_(made.picture_depth.head.weight, std=0.1)
    return made


def distances(made: RefinementBranch, seen: PosedVideo) -> Tensor:
    torch.manual_seed(3)
    keys = len(seen.keys)
    tokens = torch.randn(1, MODEL.ldrm.width, keys, SIDE // 16, SIDE // 16)
    return made(tokens, seen, moving=False).gaussians[:, -1]


def test_a_fresh_one_says_plane() -> None:
    assert bool((MonocularDepthNet(4)(torch.rand(2, 3, 32, 48)) == 0).all())


@pytest.mark.parametrize("size", [(16, 16), (64, 32), (16, 96)])
def test_every_pixel_of_any_multiple_has_a_distance(size: tuple[int, int]) -> None:
    assert size[0] % MULTIPLE_PX == size[1] % MULTIPLE_PX == 0
    found = network()(torch.rand(2, 3, *size))
    assert found.shape == (2, 1, *size) and bool(found.isfinite().all())


def test_every_weight_learns() -> None:
    made = network()
    made(torch.rand(1, 3, 32, 32)).square().mean().backward()
    for name, weight in made.named_parameters():
        assert weight.grad is not None and bool(weight.grad.isfinite().all()), name
        assert bool((weight.grad != 0).any()), name


def test_pictures_of_a_batch_do_not_see_each_other() -> None:
    made, pictures = network(), torch.rand(3, 3, 32, 32)
    alone = torch.cat([made(picture[None]) for picture in pictures])
    torch.testing.assert_close(made(pictures), alone, atol=1e-5, rtol=1e-5)


def test_one_picture_is_told_and_a_video_is_not() -> None:
    made = branch()
    before = {frames: distances(made, sight(frames)) for frames in (1, 5)}
    with torch.no_grad():
        made.picture_depth.head.bias += 1
    after = {frames: distances(made, sight(frames)) for frames in (1, 5)}
    torch.testing.assert_close(after[1], before[1] + 1)
    assert torch.equal(after[5], before[5])


def test_without_one_the_decoder_decides() -> None:
    made, seen = branch(), sight(1)
    made.picture_depth = None
    before = distances(made, seen)
    with torch.no_grad():
        made.pixels.distance.bias += 1
    torch.testing.assert_close(distances(made, seen), before + 1)
