"""Cameras that turn about their centre, what the first view shows of theirs, and the table."""

import pytest
import torch

from benchmarks.photograph_sheet.turned_views import Turned, row, shown_by_first, turned
from diff4splat.geometry.camera import pinhole, project
from diff4splat.geometry.rays import camera_rays

SIZE_PX = (24, 32)


@pytest.mark.parametrize("right_deg", [-40.0, -10.0, 0.0, 10.0, 40.0])
def test_the_first_view_shows_what_lies_in_its_frame(right_deg: float) -> None:
    first = pinhole(24.0, SIZE_PX)
    other = turned(first, right_deg)
    directions = camera_rays(other) @ other.world_from_camera[:3, :3].mT
    assert float(directions[12, 16, 0]) * right_deg >= 0
    pixels, depth = project(first, directions.flatten(0, 1))
    inside = ((pixels > 0) & (pixels < torch.tensor([32.0, 24.0]))).all(-1) & (depth > 0)
    assert torch.equal(shown_by_first(first, right_deg), inside.view(SIZE_PX))


def test_equal_views_are_at_no_distance() -> None:
    images = torch.rand(3, *SIZE_PX, 3, generator=torch.Generator().manual_seed(0))
    outside = torch.zeros(SIZE_PX, dtype=torch.bool)
    outside[:, 20:] = True
    views = [Turned(found=image, truth=image, outside=outside) for image in images]
    assert row("10°", views) == "| 10° | 100.00 | 0.0000 | 0.000 | 1.00 |"
    flat = [
        Turned(found=torch.full_like(v.truth, 0.5), truth=v.truth, outside=outside) for v in views
    ]
    assert row("flat", flat).endswith("| 0.00 |")
