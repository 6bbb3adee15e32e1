"""What lies around a picture is pushed behind it, along its own rays."""

from dataclasses import replace

import pytest
import torch

from diff4splat.generation.layered_image.occlusion_order import BEHIND, push_behind_surface
from diff4splat.geometry.camera import Camera, pinhole, project
from diff4splat.scene.gaussians import Gaussians

GRID = (8, 12)
POSE = torch.tensor(
    [[0.8, 0.0, 0.6, 1.0], [0.0, 1.0, 0.0, -2.0], [-0.6, 0.0, 0.8, 0.5], [0.0, 0.0, 0.0, 1.0]]
)


def camera() -> Camera:
    return pinhole(10.0, GRID).with_pose(POSE)


def seen_at(own: list[list[float]]) -> Gaussians:
    """Gaussians at places in camera space."""
    places = torch.tensor(own).view(-1, 3)
    count = len(places)
    return Gaussians(
        means=places @ POSE[:3, :3].mT + POSE[:3, 3],
        quats=torch.tensor([[1.0, 0.0, 0.0, 0.0]]).repeat(count, 1),
        scales=torch.full((count, 3), 0.2),
        opacities=torch.full((count,), 0.5),
        sh=torch.zeros(count, 1, 3),
    )


def test_what_stands_before_the_picture_goes_behind_it_and_grows() -> None:
    given = seen_at([[0.0, 0.0, 2.0], [0.3, 0.1, 3.0]])
    found = push_behind_surface(given, torch.full(GRID, 4.0), camera())
    before, after = (project(camera(), one.means) for one in (given, found))
    torch.testing.assert_close(after[0], before[0], atol=1e-4, rtol=0)
    torch.testing.assert_close(after[1], torch.full((2,), 4.0 * BEHIND))
    grown = (after[1] / before[1])[:, None]
    torch.testing.assert_close(found.scales, given.scales * grown)


def test_what_lies_behind_outside_or_at_the_back_stays() -> None:
    given = seen_at([[0.0, 0.0, 9.0], [5.0, 0.0, 2.0], [0.0, 0.0, -2.0], [0.0, 0.0, 0.0]])
    found = push_behind_surface(given, torch.full(GRID, 4.0), camera())
    torch.testing.assert_close(found.means, given.means)
    assert torch.equal(found.scales, given.scales)


def test_the_farthest_cell_around_decides() -> None:
    surface = torch.full(GRID, 4.0)
    surface[4, 7] = 8.0
    found = push_behind_surface(seen_at([[0.0, 0.0, 5.0]]), surface, camera())
    torch.testing.assert_close(project(camera(), found.means)[1], torch.tensor([8.0 * BEHIND]))


def test_a_footprint_is_looked_at_as_far_as_it_reaches() -> None:
    surface = torch.full(GRID, 4.0)
    surface[4, 10] = 8.0
    # Four cells from the middle; at z = 5 one of the grid's cells is 0.5 wide.
    for sigma_cells, wanted in [(0.5, 5.0), (1.5, 8.0 * BEHIND)]:
        given = seen_at([[0.0, 0.0, 5.0]])
        given = replace(given, scales=torch.full((1, 3), 0.5 * sigma_cells))
        found = push_behind_surface(given, surface, camera())
        z = project(camera(), found.means)[1]
        torch.testing.assert_close(z, torch.tensor([wanted]))


def test_what_reaches_into_the_picture_from_outside_is_pushed_too() -> None:
    # One and two standard deviations beside the left border, and four.
    given = seen_at([[-1.4, 0.0, 2.0], [-1.6, 0.0, 2.0], [-2.2, 0.0, 2.0]])
    found = push_behind_surface(given, torch.full(GRID, 4.0), camera())
    z = project(camera(), found.means)[1]
    torch.testing.assert_close(z, torch.tensor([4.0 * BEHIND, 4.0 * BEHIND, 2.0]))


@pytest.mark.parametrize("extreme", [1e-30, 1e30, float("inf")])
def test_extreme_sizes_stay_what_they_are(extreme: float) -> None:
    given = seen_at([[0.0, 0.0, 2.0], [0.0, 0.0, 2.0]])
    given.scales[0] = extreme
    found = push_behind_surface(given, torch.full(GRID, 4.0), camera())
    torch.testing.assert_close(project(camera(), found.means)[1], torch.full((2,), 4.0 * BEHIND))
    assert not bool(found.scales.isnan().any())


def test_a_picture_that_shows_nothing_asks_for_nothing() -> None:
    given = seen_at([[0.0, 0.0, 2.0]])
    found = push_behind_surface(given, torch.zeros(GRID), camera())
    torch.testing.assert_close(found.means, given.means)


def test_nobody_around_is_fine() -> None:
    assert len(push_behind_surface(seen_at([]), torch.full(GRID, 4.0), camera())) == 0
