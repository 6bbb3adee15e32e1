import numpy as np
import pytest
import torch

from diff4splat.data.clip import Clip
from diff4splat.data_prep.synthetic.arrangements.backdrops import KINDS, make_backdrop
from diff4splat.data_prep.synthetic.arrangements.objects import HIGH_LIFT_M, arrange
from diff4splat.data_prep.synthetic.renderer.clips import draw_clip
from diff4splat.data_prep.synthetic.renderer.settings import DrawSettings
from diff4splat.data_prep.synthetic.rng import Rng
from diff4splat.data_prep.synthetic.world import World
from diff4splat.data_prep.synthetic.worlds import WorldRecipe, make_world
from diff4splat.errors import ConfigError

COUNT = 6
SPLIT = WorldRecipe(families=("ball", "crate", "chair")).allowed()


def recipe(**settings) -> WorldRecipe:
    return WorldRecipe(
        **{"seed": 5, "frames": 1, "views": 4, "size_px": (32, 32), "arrangements": True} | settings
    )


@pytest.fixture(scope="module")
def worlds() -> list[World]:
    return [make_world(recipe(), index) for index in range(COUNT)]


@pytest.fixture(scope="module")
def clips(worlds: list[World]) -> list[Clip]:
    settings = DrawSettings(tracks=0, flow=False, samples_per_side=1, shadow_px=64)
    return [draw_clip(world, settings) for world in worlds]


def test_nothing_moves(worlds: list[World]) -> None:
    assert all(world.note.is_static for world in worlds)
    assert all(len(item.positions) == 1 for world in worlds for item in world.objects)


def test_cameras_stay_above_the_surface_and_out_of_objects(clips: list[Clip]) -> None:
    for clip in clips:
        for view in clip.views:
            depth = view.depth[view.depth > 0]
            assert len(depth) == 0 or float(depth.min()) > 0.005


@pytest.mark.parametrize("is_portrait", [False, True])
def test_high_objects_leave_a_gap_below_and_others_stand(is_portrait: bool) -> None:
    gaps = {}
    for is_high in (False, True):
        items = [
            item
            for number in range(8)
            for item in arrange(SPLIT, Rng(3, number), is_portrait=is_portrait, is_high=is_high)
        ]
        low = [max(float(part[..., 1].max()) for part in item.placed.parts) for item in items]
        gaps[is_high] = -np.array(low)
    least, most = HIGH_LIFT_M
    assert gaps[True].min() >= least - 1e-9 and gaps[True].max() <= most + 1e-9
    assert np.median(gaps[False]) < 1e-9


def test_the_image_row_does_not_tell_depth(clips: list[Clip]) -> None:
    """The correlation of row and depth has both signs, and is often weak."""
    found = [_row_correlation(view.depth[0]) for clip in clips for view in clip.views]
    assert min(found) < -0.3 and max(found) > 0.3
    assert np.abs(found).mean() < 0.85


def _row_correlation(depth: torch.Tensor) -> float:
    known = depth > 0
    rows = torch.arange(len(depth)).double()[:, None].expand(depth.shape)
    pairs = torch.stack([rows[known], depth[known].double().log()])
    return float(torch.corrcoef(pairs)[0, 1].nan_to_num())


def test_equal_recipes_give_equal_worlds(worlds: list[World]) -> None:
    again = make_world(recipe(), 1)
    for one, other in zip(worlds[1].objects, again.objects, strict=True):
        assert np.array_equal(one.positions, other.positions)
    for one, other in zip(worlds[1].views, again.views, strict=True):
        assert torch.equal(one.world_from_camera, other.world_from_camera)


@pytest.mark.parametrize("kind", KINDS)
def test_every_backdrop_is_finite_and_leaves_room(kind: str) -> None:
    backdrop = make_backdrop(kind, Rng("test", kind))
    points = np.concatenate([part[0] for item in backdrop.objects for part in item.parts])
    assert np.isfinite(points).all()
    assert min(*backdrop.half_m, backdrop.height_m) > 1.0


def test_walls_of_a_room_surround_the_cameras() -> None:
    backdrop = make_backdrop("room", Rng("test", "walls"))
    panels = [item for item in backdrop.objects if item.family == "panel"]
    centers = np.array([item.parts[0][0].mean(0) for item in panels[1:5]])
    assert centers[:, 0].min() < -1 and centers[:, 0].max() > 1
    assert centers[:, 2].min() < -1 and centers[:, 2].max() > 1


def test_arrangements_exclude_other_cameras() -> None:
    with pytest.raises(ConfigError, match="keep one"):
        recipe(free_cameras=True)
