"""Fill that the input view would show goes, fill behind the image stays."""

import torch
from torch import Tensor

from diff4splat.generation.layered_image.gaussians import GaussianSet
from diff4splat.generation.layered_image.types import NO_PIXEL
from diff4splat.generation.video.hidden_cells import FillGrid
from diff4splat.generation.video.video_fill import VideoFill
from diff4splat.generation.visible_fill import visible_px, without_visible
from diff4splat.geometry.camera import Camera, pinhole
from diff4splat.models.ldrm.gaussian_head import PixelBase
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.static import StaticMotion

CAMERA = pinhole(16.0, (16, 16))


def discs(means: Tensor, scale: float) -> GaussianSet:
    count = len(means)
    gaussians = Gaussians(
        means=means,
        quats=torch.tensor([[1.0, 0.0, 0.0, 0.0]]).repeat(count, 1),
        scales=torch.full((count, 3), scale),
        opacities=torch.full((count,), 0.99),
        sh=torch.zeros(count, 1, 3),
    )
    index = torch.full((count,), NO_PIXEL)
    return GaussianSet(gaussians=gaussians, motion=StaticMotion(), pixel_index=index)


def wall(depth: float) -> GaussianSet:
    """One opaque disc per pixel."""
    y, x = torch.meshgrid(*(torch.arange(16) + 0.5,) * 2, indexing="ij")
    plane = torch.stack([(x - 8) / 16, (y - 8) / 16, torch.ones_like(x)], -1).reshape(-1, 3)
    return discs(plane * depth, depth / 16)


def fill_of(means: list[list[float]]) -> VideoFill:
    gaussians = discs(torch.tensor(means).reshape(-1, 3), 0.1)
    base = PixelBase(
        rgb=torch.zeros(1, 16, 16, 3),
        distance=torch.ones(1, 16, 16),
        opacity=torch.ones(1, 16, 16),
        cameras=Camera(
            focal_px=CAMERA.focal_px[None],
            center_px=CAMERA.center_px[None],
            world_from_camera=CAMERA.world_from_camera[None],
            size_px=CAMERA.size_px,
        ),
    )
    filled = torch.zeros(1, 16, 16, dtype=torch.bool)
    filled.view(-1)[: len(gaussians.gaussians)] = True
    grid = FillGrid(base=base, depth=torch.ones(1, 16, 16), filled=filled)
    count = torch.arange(len(gaussians.gaussians))
    return VideoFill(gaussians=gaussians, cell_index=count, grid=grid)


def test_only_what_the_image_hides_is_kept() -> None:
    behind, before, beside_the_border = [0.0, 0.0, 4.0], [0.0, 0.0, 1.0], [0.51, 0.0, 1.0]
    far_outside = [5.0, 0.0, 1.0]
    fill = fill_of([before, behind, beside_the_border, far_outside])
    kept = without_visible(fill, wall(2.0), CAMERA)
    assert kept.gaussians.gaussians.means.tolist() == torch.tensor([behind, far_outside]).tolist()
    assert kept.cell_index.tolist() == [1, 3]
    assert kept.grid.filled.flatten()[:5].tolist() == [False, True, False, True, False]


def test_an_empty_fill_stays_empty() -> None:
    kept = without_visible(fill_of([]), wall(2.0), CAMERA)
    assert len(kept.gaussians.gaussians) == 0
    assert not kept.grid.filled.any()


def test_shares_of_opaque_pixels_sum_to_the_pixels() -> None:
    shown = visible_px(wall(2.0).gaussians, CAMERA)
    assert bool(torch.isfinite(shown).all())
    assert 0.95 * 256 < float(shown.sum()) <= 256


def test_no_gradient_is_left_behind() -> None:
    with torch.no_grad():
        kept = without_visible(fill_of([[0.0, 0.0, 4.0]]), wall(2.0), CAMERA)
    assert not kept.gaussians.gaussians.sh.requires_grad
