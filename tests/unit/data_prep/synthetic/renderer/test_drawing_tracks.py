"""Numbers of a clip agree with each other: tracks, depth, flow, cameras."""

import numpy as np
import oracles_drawing as oracle
import pytest
import torch

from diff4splat.data.clip import Clip
from diff4splat.data_prep.synthetic.renderer.clips import draw_clip
from diff4splat.data_prep.synthetic.renderer.settings import DrawSettings
from diff4splat.geometry.camera import project


@pytest.fixture(scope="module")
def clip() -> Clip:
    world = oracle.still_life(4, (24, 32), 3)
    return draw_clip(world, DrawSettings(samples_per_side=2, tracks=120, shadow_px=64))


def test_the_first_camera_is_the_world(clip: Clip) -> None:
    first = clip.views[0].cameras.world_from_camera[0]
    assert torch.equal(first, torch.eye(4, dtype=torch.float64))


def test_cameras_stay_where_they_are_to_each_other(clip: Clip) -> None:
    world = oracle.still_life(4, (24, 32), 3)
    origin = torch.linalg.inv(world.views[0].world_from_camera[0])
    for before, after in zip(world.views, clip.views, strict=True):
        want = origin @ before.world_from_camera
        torch.testing.assert_close(after.cameras.world_from_camera, want, rtol=0, atol=1e-12)


def test_tracks_project_to_their_coordinates_in_every_view(clip: Clip) -> None:
    for view in clip.views:
        uv, _ = project(view.cameras, clip.tracks.positions.double())
        assert (uv - view.track_uv).abs().max() < 1e-3


def test_points_were_found_at_pixel_centres_where_depth_and_flow_agree(clip: Clip) -> None:
    for at, (where, frame) in enumerate(clip.tracks.found_at.tolist()):
        view = clip.views[where]
        u, v = view.track_uv[frame, at].tolist()
        row, column = int(v), int(u)
        assert (u, v) == (column + 0.5, row + 0.5)
        assert view.track_visible[frame, at]
        assert view.instances[frame, row, column] == clip.tracks.instances[at]
        z = project(view.cameras[frame], clip.tracks.positions[frame, at].double()[None])[1]
        assert abs(float(z) / float(view.depth[frame, row, column]) - 1) < 1e-6
        if frame + 1 < clip.frames:
            moved = view.track_uv[frame + 1, at] - view.track_uv[frame, at]
            assert (moved - view.flow.to_next[frame, row, column]).abs().max() < 1e-3
            seen = view.flow.visible[frame, row, column]
            assert seen == view.track_visible[frame + 1, at]


def test_half_of_the_points_move_and_all_are_different(clip: Clip) -> None:
    assert (clip.tracks.instances == 9).sum() == 60
    assert clip.tracks.positions.shape == (4, 120, 3)
    found = torch.cat([clip.tracks.found_at, clip.views[0].track_uv[0].long()], 1)
    assert len(found.unique(dim=0)) > 100
    assert len(clip.tracks.found_at.unique(dim=0)) == 12
    still = clip.tracks.positions[:, clip.tracks.instances != 9]
    assert torch.equal(still, still[:1].expand_as(still))


def test_fewer_pixels_give_fewer_points() -> None:
    world = oracle.still_life(2, (4, 4), 1)
    clip = draw_clip(world, DrawSettings(samples_per_side=2, tracks=500, shadow_px=16))
    assert 0 < clip.tracks.positions.shape[1] <= 32


def test_without_objects_there_is_sky_and_nothing_to_follow() -> None:
    world = oracle.world([], [oracle.straight(2, (8, 8))], 2)
    clip = draw_clip(world, DrawSettings(samples_per_side=2, shadow_px=16))
    assert clip.tracks.positions.shape == (2, 0, 3)
    assert clip.views[0].track_uv.shape == (2, 0, 2)
    assert (clip.views[0].depth == 0).all()
    assert clip.views[0].rgb.float().mean() > 60


def test_points_behind_the_camera_have_finite_coordinates() -> None:
    camera = oracle.straight(3, (8, 8), (0.0, 0.0, 3.0))
    wall = oracle.mesh([[-9, -9, 2], [9, -9, 2], [0, 9, 2]], [[0, 1, 2]])
    world = oracle.world([oracle.thing(1, wall)], [camera], 3)
    clip = draw_clip(world, DrawSettings(samples_per_side=2, tracks=10, shadow_px=16))
    view = clip.views[0]
    assert view.track_uv.isfinite().all()
    assert not view.track_visible[1:].any()
    assert not view.flow.known[0][view.instances[0] == 1].any()
    assert np.isfinite(view.flow.to_next.numpy()).all()
