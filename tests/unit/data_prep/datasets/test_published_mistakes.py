"""Mistakes of public loaders, and hard cases of the formats: ours makes none of them."""

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import torch
from dataset_writers import (
    dynamic_replica,
    matrixcity,
    multicam_video,
    point_odyssey,
    realestate10k,
    spring,
    stereo4d,
    tartanair,
    vkitti2,
)
from toy_datasets import TOYS, read_clips

from diff4splat.data_prep.datasets.common.grid_paths import grid_paths
from diff4splat.errors import FileFormatError, InputError


def test_flow_of_dynamic_replica_is_no_raw_integer(tmp_path: Path) -> None:
    truth = TOYS["dynamic_replica"].truth()
    (clip,) = read_clips("dynamic_replica", dynamic_replica.write(truth, tmp_path))
    assert clip.views[0].flow.to_next.abs().max() < 64, "half floats as integers are thousands"


def test_minus_zero_of_dynamic_replica_is_no_depth(tmp_path: Path) -> None:
    truth = TOYS["dynamic_replica"].truth()
    (clip,) = read_clips("dynamic_replica", dynamic_replica.write(truth, tmp_path))
    corner = clip.views[0].depth[:, 0, 0]
    assert (corner == 0).all() and not torch.signbit(corner).any()


def test_the_usual_recipe_for_multicam_video_is_left_handed_and_ours_is_not(
    tmp_path: Path,
) -> None:
    truth = TOYS["multicam_video"].truth()
    root = multicam_video.write(truth, tmp_path)
    document = json.loads(next(root.rglob("*.json")).read_text())
    rows = document["frame0"]["cam01"].replace("[", "").split("]")[:3]
    stored = np.array([[float(n) for n in row.split()[:3]] for row in rows]).T
    # Reorders the columns of the camera and negates one, and leaves the world as it is.
    usual = stored[:, [1, 2, 0]] * [1, -1, 1]
    assert np.linalg.det(usual) == pytest.approx(-1)
    (clip,) = read_clips("multicam_video", root)
    for view in clip.views:
        rotation = view.cameras.world_from_camera[:, :3, :3]
        assert torch.allclose(torch.linalg.det(rotation), torch.ones(len(rotation)).double())


def test_no_shift_is_ever_added_to_translations_of_realestate10k(tmp_path: Path) -> None:
    truth = TOYS["realestate10k"].truth()
    (clip,) = read_clips("realestate10k", realestate10k.write(truth, tmp_path))
    want = np.linalg.inv(truth.left.poses[0]) @ truth.left.poses
    position = clip.views[0].cameras.position.numpy()
    assert np.abs(position - want[:, :3, 3]).max() < 1e-9
    assert clip.note.scale is None and clip.note.metric == "none"


def test_cameras_stay_in_double_precision(tmp_path: Path) -> None:
    truth = TOYS["realestate10k"].truth()
    (clip,) = read_clips("realestate10k", realestate10k.write(truth, tmp_path))
    assert clip.views[0].cameras.world_from_camera.dtype == torch.float64


@pytest.mark.parametrize("kind", ["half", "float", "packaged"])
def test_opengl_columns_of_matrixcity_become_opencv(kind: str, tmp_path: Path) -> None:
    toy = TOYS[f"matrixcity {kind}"]
    truth = toy.truth()
    toy.write(truth, tmp_path)
    (clip,) = read_clips("matrixcity", tmp_path)
    want = np.linalg.inv(truth.left.poses[0]) @ truth.left.poses
    assert np.abs(clip.views[0].cameras.world_from_camera.numpy() - want).max() < 1e-6


def test_flow_of_tartanair_is_dropped_nowhere_but_hidden_where_its_mask_says(
    tmp_path: Path,
) -> None:
    truth = TOYS["tartanair"].truth()
    (clip,) = read_clips("tartanair", tartanair.write(truth, tmp_path))
    hidden = ~truth.left.forward_seen
    assert not clip.views[0].flow.visible.numpy()[hidden].any()


def test_depth_of_tartanair_is_float32_and_not_16_bits(tmp_path: Path) -> None:
    root = tartanair.write(TOYS["tartanair"].truth(), tmp_path)
    file = next(root.rglob("*_left_depth.npy"))
    np.save(file, np.load(file).astype(np.float16))
    with pytest.raises(FileFormatError, match=r"expected float32 of shape .*, got float16"):
        read_clips("tartanair", root)


def test_tartanair_v2_is_refused_by_name(tmp_path: Path) -> None:
    (tmp_path / "AbandonedCable" / "Data_easy" / "P000" / "image_lcam_front").mkdir(parents=True)
    with pytest.raises(InputError, match="expected TartanAir version 1, got TartanAir V2"):
        read_clips("tartanair", tmp_path)


def test_old_names_of_point_odyssey_are_refused_by_name(tmp_path: Path) -> None:
    root = point_odyssey.write(TOYS["point_odyssey"].truth(), tmp_path)
    file = next(root.rglob("anno.npz"))
    file.rename(file.with_name("annotations.npz"))
    with pytest.raises(InputError, match=r"expected anno.npz of version 1.2, got annotations.npz"):
        read_clips("point_odyssey", root)


@pytest.mark.parametrize("said", [0, 32])
def test_empty_tracks_of_point_odyssey_are_none(said: int, tmp_path: Path) -> None:
    root = point_odyssey.write(TOYS["point_odyssey"].truth(), tmp_path, tracks=said)
    (clip,) = read_clips("point_odyssey", root)
    assert clip.tracks is None
    assert clip.motion_truth == "unknown"


def test_openexr_is_read_although_opencv_cannot(tmp_path: Path) -> None:
    root = matrixcity.write(TOYS["matrixcity half"].truth(), tmp_path)
    (clip,) = read_clips("matrixcity", root)
    assert (clip.views[0].depth > 0).any()


def test_depth_of_matrixcity_is_in_centimetres_and_not_in_units_of_100_m(tmp_path: Path) -> None:
    root = matrixcity.write(TOYS["matrixcity half"].truth(), tmp_path)
    (clip,) = read_clips("matrixcity", root)
    depth = clip.views[0].depth
    assert 2 < float(depth[depth > 0].median()) < 12


def test_indices_of_matrixcity_are_no_video() -> None:
    """Two viewing directions in turns along one street with a gap: four paths."""
    poses = np.tile(np.eye(4), (20, 1, 1))
    turned = np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]])
    for index in range(20):
        place = index // 2
        poses[index, :3, :3] = turned if index % 2 else np.eye(3)
        poses[index, 0, 3] = 5 * place + (40 if place >= 6 else 0)
    shuffled = np.random.default_rng(0).permutation(20)
    shuffled = np.concatenate([[0, 1], shuffled[shuffled > 1]])
    paths = [shuffled[path] for path in grid_paths(poses[shuffled])]
    assert sorted(sorted(path.tolist()) for path in paths) == sorted(
        [list(range(d, 12, 2)) for d in (0, 1)] + [list(range(12 + d, 20, 2)) for d in (0, 1)]
    )
    for path in paths:
        steps = np.diff(poses[path, 0, 3])
        assert (np.abs(steps) == 5).all()


def test_edges_of_matrixcity_are_left_out(tmp_path: Path) -> None:
    truth = TOYS["matrixcity float"].truth()
    (clip,) = read_clips("matrixcity", matrixcity.write(truth, tmp_path, half=False))
    lost = (clip.views[0].depth.numpy() == 0) & (truth.left.which >= 0)
    near = [
        cv2.dilate(d, np.ones((3, 3))) > 1.1 * cv2.erode(d, np.ones((3, 3)))
        for d in np.where(truth.left.which >= 0, truth.left.depth, 0).astype(np.float32)
    ]
    assert (lost <= np.stack(near)).all()


def test_values_of_spring_are_pixels_of_the_image_already(tmp_path: Path) -> None:
    truth = TOYS["spring"].truth()
    (clip,) = read_clips("spring", spring.write(truth, tmp_path))
    known = truth.left.which[0] >= 0
    ratio = clip.views[0].depth[0].numpy()[known] / truth.left.depth[0][known]
    assert np.allclose(ratio, 1, atol=1e-5), "halved disparity doubles depth"


def test_focal_lengths_of_spring_change_over_time(tmp_path: Path) -> None:
    root = spring.write(TOYS["spring"].truth(), tmp_path)
    file = next(root.rglob("intrinsics.txt"))
    lenses = np.loadtxt(file)
    lenses[2, 0] *= 2
    np.savetxt(file, lenses, "%.17g")
    (clip,) = read_clips("spring", root)
    focal = clip.views[0].cameras.focal_px[:, 0]
    assert focal[2] == 2 * focal[1]
    known = clip.views[0].depth[1] > 0
    relation = clip.views[0].depth[2][known].median() / clip.views[0].depth[1][known].median()
    assert relation > 1.5, "depth is focal length times base line over disparity"


def test_rows_of_vkitti2_belong_to_their_camera(tmp_path: Path) -> None:
    truth = TOYS["vkitti2"].truth()
    (clip,) = read_clips("vkitti2", vkitti2.write(truth, tmp_path))
    baseline = clip.views[1].cameras.position[0] - clip.views[0].cameras.position[0]
    assert torch.allclose(baseline, torch.tensor([0.532725, 0, 0]).double(), atol=1e-6)


def test_sky_of_vkitti2_is_no_depth_of_655_m(tmp_path: Path) -> None:
    truth = TOYS["vkitti2"].truth()
    (clip,) = read_clips("vkitti2", vkitti2.write(truth, tmp_path))
    assert clip.views[0].depth.max() < 100
    assert torch.equal(clip.views[0].sky, torch.from_numpy(truth.left.which < 0))


def test_one_pose_of_realestate10k_is_too_few(tmp_path: Path) -> None:
    root = realestate10k.write(TOYS["realestate10k"].truth(), tmp_path, poses=1)
    with pytest.raises(InputError, match="expected at least two poses, got 1"):
        read_clips("realestate10k", root)


def test_a_track_without_frames_is_left_out(tmp_path: Path) -> None:
    toy = TOYS["stereo4d"]
    root = stereo4d.write(toy.truth(), tmp_path)
    with np.load(next(root.rglob("*.npz"))) as stored:
        lengths = stored["track_lengths"]
    assert (lengths == 0).sum() >= 1
    (clip,) = read_clips("stereo4d", root)
    assert clip.tracks.positions.shape[1] == (lengths > 0).sum()


def test_a_stereo4d_video_may_lack_one_frame_and_no_more(tmp_path: Path) -> None:
    truth = TOYS["stereo4d"].truth()
    (clip,) = read_clips("stereo4d", stereo4d.write(truth, tmp_path / "a", video_frames=3))
    assert clip.frames == 3
    with pytest.raises(FileFormatError, match="expected videos of 4 frames like the poses"):
        read_clips("stereo4d", stereo4d.write(truth, tmp_path / "b", video_frames=2))


def test_the_missing_last_flow_is_no_damage_and_one_in_between_is(tmp_path: Path) -> None:
    root = vkitti2.write(TOYS["vkitti2"].truth(), tmp_path)
    assert len(read_clips("vkitti2", root)) == 1
    (root / "Scene01/clone/frames/forwardFlow/Camera_0/flow_00001.png").unlink()
    with pytest.raises(FileFormatError, match=r"flow_00001.png: expected a PNG, got no such file"):
        read_clips("vkitti2", root)


def test_swapped_eyes_are_noticed(tmp_path: Path) -> None:
    for name, module in (("vkitti2", vkitti2), ("tartanair", tartanair)):
        truth = TOYS[name].truth()
        swapped = replace(truth, eyes=truth.eyes[::-1])
        with pytest.raises(FileFormatError, match="left and right are swapped"):
            read_clips(name, module.write(swapped, tmp_path / name))
