import math
from dataclasses import replace

import torch
from oracles_render import random_gaussians, small_camera

from diff4splat.geometry.camera import pinhole
from diff4splat.render.projection import Footprints
from diff4splat.render.settings import RenderSettings
from diff4splat.render.support import pixel_boxes, visible_order

SIZE = (20, 30)


def prints(center: tuple[float, float], sigma: tuple[float, float], opacity: float) -> Footprints:
    """One upright footprint."""
    return Footprints(
        center_px=torch.tensor([center]),
        depth=torch.ones(1),
        sigma_px=torch.tensor([sigma]),
        whitening=torch.tensor([[1 / sigma[0], 0.0, 1 / sigma[1]]]),
        opacities=torch.tensor([opacity]),
    )


def box(center: tuple[float, float], sigma: tuple[float, float], opacity: float) -> list[int]:
    return pixel_boxes(prints(center, sigma, opacity), SIZE, 1 / 255)[0].tolist()


def test_the_box_holds_exactly_the_pixels_above_the_cutoff() -> None:
    columns = torch.arange(SIZE[1]) + 0.5
    alpha = 0.7 * torch.exp(-0.5 * ((columns - 12.3) / 2.0) ** 2)
    reached = (alpha >= 1 / 255).nonzero().squeeze(1)
    left, _, right, _ = box((12.3, 10.0), (2.0, 1.0), 0.7)
    assert [left, right] == [int(reached[0]), int(reached[-1]) + 1]


def test_support_shrinks_with_opacity() -> None:
    radius = math.sqrt(2 * math.log(0.1 * 255))
    assert box((15.0, 10.0), (2.0, 1.0), 0.1) == [
        math.ceil(15 - 2 * radius - 0.5),
        math.ceil(10 - radius - 0.5),
        math.floor(15 + 2 * radius + 0.5),
        math.floor(10 + radius + 0.5),
    ]


def test_boxes_end_at_the_image() -> None:
    assert box((15.0, 10.0), (1e20, 1e20), 0.5) == [0, 0, 30, 20]
    left, top, right, bottom = box((-50.0, 10.0), (2.0, 2.0), 0.5)
    assert right <= left
    assert top < bottom


def test_below_the_cutoff_there_is_no_support() -> None:
    assert box((15.0, 10.0), (2.0, 2.0), 0.003) == [0, 0, 0, 0]


def test_the_order_is_by_depth_then_by_index() -> None:
    gaussians = random_gaussians(6)
    means = torch.zeros(6, 3, dtype=torch.float64)
    means[:, 2] = torch.tensor([3.0, 1.0, 2.0, 1.0, 2.0, -1.0])
    order, dropped = visible_order(
        replace(gaussians, means=means), pinhole(10.0, SIZE, torch.float64), RenderSettings()
    )
    assert order.tolist() == [1, 3, 2, 4, 0]
    assert dropped == {}


def test_what_is_not_seen_is_not_kept() -> None:
    gaussians, camera = random_gaussians(5), small_camera()
    means = gaussians.means.clone()
    means[0] = torch.tensor([100.0, 0.0, 3.0])
    means[1, 2] = -2.0
    opacities = gaussians.opacities.clone()
    opacities[2] = 0.0039
    scales = gaussians.scales.clone()
    scales[3] = 0.0
    changed = replace(gaussians, means=means, opacities=opacities, scales=scales)
    order, _ = visible_order(changed, camera, RenderSettings(dilation_px2=0.0))
    assert order.tolist() == [4]
