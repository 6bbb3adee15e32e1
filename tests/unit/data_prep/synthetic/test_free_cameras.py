import numpy as np
import pytest
import torch

from diff4splat.data_prep.synthetic.world import World
from diff4splat.data_prep.synthetic.worlds import WorldRecipe, make_world
from diff4splat.errors import ConfigError
from diff4splat.geometry.rigid import require_rigid

COUNT = 4


@pytest.fixture(scope="module")
def worlds() -> list[World]:
    recipe = WorldRecipe(
        seed=5, still_share=1.0, frames=1, views=8, size_px=(32, 32), free_cameras=True
    )
    return [make_world(recipe, index) for index in range(COUNT)]


def test_cameras_differ_in_tilt_roll_distance_and_lens(worlds: list[World]) -> None:
    axes = torch.stack([view.world_from_camera[0, :3, :3] for w in worlds for view in w.views])
    tilts_deg = torch.rad2deg(torch.asin(axes[:, 1, 2]))
    rolls_deg = torch.rad2deg(torch.asin(axes[:, 1, 0]))
    focal_px = torch.stack([view.focal_px[0] for w in worlds for view in w.views]).flatten()
    assert tilts_deg.max() - tilts_deg.min() > 45
    assert rolls_deg.abs().max() > 10
    assert focal_px.max() / focal_px.min() > 2


def test_cameras_are_rigid_and_above_the_ground(worlds: list[World]) -> None:
    for world in worlds:
        for view in world.views:
            require_rigid(view.world_from_camera, "view", tolerance=1e-8)
            assert float(view.position[:, 1].max()) < 0


def test_the_first_camera_is_level(worlds: list[World]) -> None:
    for world in worlds:
        assert float(world.views[0].world_from_camera[0, 1, 0].abs()) < 1e-6


def test_names_of_clips_tell_the_arrangement(worlds: list[World]) -> None:
    assert all(world.note.identifier.endswith("-free") for world in worlds)
    assert np.unique([world.note.identifier for world in worlds]).size == COUNT


def test_two_arrangements_are_refused() -> None:
    with pytest.raises(ConfigError, match="keep one"):
        WorldRecipe(rig=True, free_cameras=True, views=8)
