"""Every reader gives the analytic truth back, to the quantisation of its format."""

from pathlib import Path

import numpy as np
import pytest
import torch
from dataset_writers import matrixcity, stereo4d
from toy_datasets import TOYS, ToySet, read_clips
from toy_scene import Eye, Truth

from diff4splat.data.clip import Clip, View
from diff4splat.data.codecs.encode import encode_clip


@pytest.fixture(scope="module", params=TOYS)
def read(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> tuple[ToySet, Truth, Clip]:
    toy = TOYS[request.param]
    root = tmp_path_factory.mktemp("räume mit leerzeichen")
    toy.write(toy.truth(), root)
    (clip,) = read_clips(toy.dataset, root)
    return toy, toy.truth(), clip


def pairs(truth: Truth, clip: Clip) -> list[tuple[Eye, View]]:
    assert len(truth.eyes) == len(clip.views)
    return list(zip(truth.eyes, clip.views, strict=True))


def home(truth: Truth) -> np.ndarray:
    return np.linalg.inv(truth.left.poses[0])


def test_poses_are_right_handed_and_where_they_were(read: tuple[ToySet, Truth, Clip]) -> None:
    toy, truth, clip = read
    for eye, view in pairs(truth, clip):
        poses = view.cameras.world_from_camera
        assert torch.allclose(torch.linalg.det(poses[:, :3, :3]), torch.ones(4).double())
        assert np.abs(poses.numpy() - home(truth) @ eye.poses).max() <= toy.pose


def test_intrinsics_are_in_pixels_with_centres_at_a_half(
    read: tuple[ToySet, Truth, Clip],
) -> None:
    _, truth, clip = read
    for eye, view in pairs(truth, clip):
        camera = view.cameras
        found = torch.cat([camera.focal_px, camera.center_px], -1).numpy()
        assert np.allclose(found, eye.lens, rtol=1e-6)


def test_depth_is_z_in_metres_and_sky_is_0(read: tuple[ToySet, Truth, Clip]) -> None:
    toy, truth, clip = read
    for eye, view in pairs(truth, clip):
        if toy.depth_relative is None:
            assert view.depth is None or toy.dataset == "stereo4d"
            continue
        found, sky = view.depth.numpy(), eye.which < 0
        assert (found[sky] == 0).all()
        shown = (found > 0) & ~sky
        assert shown.sum() > (0.6 if toy.dataset == "matrixcity" else 0.99) * (~sky).sum()
        error = np.abs(found[shown] - eye.depth[shown])
        assert (error <= toy.depth_m + toy.depth_relative * eye.depth[shown]).all()
        assert view.sky is None or np.array_equal(view.sky.numpy(), sky)


def test_flow_goes_to_the_next_frame(read: tuple[ToySet, Truth, Clip]) -> None:
    toy, truth, clip = read
    flows = [(eye, view.flow) for eye, view in pairs(truth, clip) if view.flow is not None]
    assert bool(flows) == (toy.flow_px is not None)
    for eye, flow in flows:
        known = np.isfinite(eye.forward).all(-1)
        found = flow.known.numpy()
        assert (found <= known).all() or toy.dataset == "tartanair"
        both = known & found
        assert both.sum() == known.sum()
        relative, absolute = toy.flow_px
        error = np.abs(flow.to_next.numpy()[both] - eye.forward[both])
        assert (error <= absolute + relative * np.abs(eye.forward[both])).all()
        agrees = flow.visible.numpy()[both] == eye.forward_seen[both]
        assert agrees.mean() > 0.95


def test_tracks_are_where_they_were(read: tuple[ToySet, Truth, Clip]) -> None:
    toy, truth, clip = read
    tracked = toy.dataset in ("point_odyssey", "dynamic_replica", "stereo4d")
    assert (clip.tracks is not None) == tracked
    if not tracked:
        return
    want = truth.positions @ home(truth)[:3, :3].T + home(truth)[:3, 3]
    known = clip.tracks.known
    known = np.ones(want.shape[:2], bool) if known is None else known.numpy()
    found = clip.tracks.positions.numpy()
    for place in range(found.shape[1]):
        here = known[:, place]
        errors = np.abs(want[here] - found[here, place][:, None]).max((0, 2))
        match = errors.argmin()
        assert errors[match] < 1e-4
        visible = clip.views[0].track_visible[:, place].numpy()
        uv = clip.views[0].track_uv[:, place].numpy()
        assert not (visible & ~truth.visible[:, match]).any()
        assert np.abs(uv[visible] - truth.uv[visible, match]).max() < 1e-2
    seen = clip.views[0].track_visible.sum()
    assert truth.visible.sum() - 6 <= int(seen) <= truth.visible.sum()


def test_images_and_facts(read: tuple[ToySet, Truth, Clip]) -> None:
    toy, truth, clip = read
    for eye, view in pairs(truth, clip):
        assert np.abs(view.rgb.numpy().astype(int) - eye.rgb).mean() <= toy.rgb
    metric, license_name, static, fps = toy.facts
    note = clip.note
    assert (note.metric, note.license, note.is_static) == (metric, license_name, static)
    assert note.dataset == toy.dataset
    assert clip.fps == (None if fps is None else pytest.approx(fps, rel=1e-3))
    assert note.commercial_ok == ("NC" not in license_name)
    truth_of_motion = "static" if static else "tracks" if clip.tracks else "unknown"
    assert clip.motion_truth == truth_of_motion


def test_it_can_be_stored(read: tuple[ToySet, Truth, Clip]) -> None:
    assert encode_clip(read[2]).entry.dataset == read[0].dataset


def test_sparse_depth_of_stereo4d_is_that_of_its_tracks(tmp_path: Path) -> None:
    toy = TOYS["stereo4d"]
    (clip,) = read_clips("stereo4d", stereo4d.write(toy.truth(), tmp_path))
    depth = clip.views[0].depth.numpy()
    shown = depth > 0
    assert 0 < shown.sum() <= toy.truth().visible.sum()
    relative = np.abs(depth[shown] - toy.truth().left.depth[shown]) / depth[shown]
    assert np.median(relative) < 0.02


def test_a_city_out_of_a_tar_is_the_same(tmp_path: Path) -> None:
    truth = TOYS["matrixcity half"].truth()
    matrixcity.write(truth, tmp_path)
    matrixcity.pack(tmp_path)
    (clip,) = read_clips("matrixcity", tmp_path)
    assert np.array_equal(clip.views[0].rgb.numpy(), truth.left.rgb)


def test_windows_and_sizes(tmp_path: Path) -> None:
    toy = TOYS["dynamic_replica"]
    toy.write(toy.truth(), tmp_path)
    clips = read_clips("dynamic_replica", tmp_path, frames=2, max_side_px=32, most_tracks=10)
    assert [clip.frames for clip in clips] == [2, 2]
    assert len({clip.note.identifier for clip in clips}) == 2
    for clip in clips:
        assert clip.size_px == (18, 32)
        first = clip.views[0].cameras.world_from_camera[0]
        assert torch.allclose(first, torch.eye(4).double())
        assert clip.tracks.positions.shape[1] == 10
        camera = clip.views[0].cameras
        assert torch.allclose(camera.focal_px, torch.tensor(22.5).double())
