"""Clips with fitted depth: truth recovered, lengths scaled and never shifted, records kept."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from textured_clips import textured_clip, without_depth

from diff4splat.data.clip_folder import ClipFolder
from diff4splat.data.shard_writer import ShardOptions, ShardWriter
from diff4splat.data_prep.alignment.align_clip import AlignmentSettings, align_clip
from diff4splat.data_prep.alignment.align_folder import AlignJob, align_folder
from diff4splat.data_prep.alignment.opencv.flow_disparity import flow_disparity
from diff4splat.data_prep.alignment.opencv.video_poses import video_poses
from diff4splat.data_prep.alignment.references.megasam_depth import megasam_reference
from diff4splat.data_prep.alignment.references.reference import Reference
from diff4splat.data_prep.alignment.references.stereo import stereo_reference
from diff4splat.data_prep.alignment.references.triangulation import triangulation_reference
from diff4splat.data_prep.alignment.tool_files.megasam import MegasamScene
from diff4splat.errors import InputError
from diff4splat.geometry.camera import pinhole
from diff4splat.progress.phases import Phases

SCALE, SHIFT = 0.05, 0.02


@pytest.fixture(scope="module")
def clip():
    return textured_clip(frames=7, moving=True)


def relative_disparity(clip) -> np.ndarray:
    return ((1 / clip.views[0].depth.numpy() - SHIFT) / SCALE).astype(np.float32)


def reference(clip, factor: float = 1.0) -> Reference:
    return Reference(
        depth=clip.views[0].depth.numpy() * np.float32(factor),
        name="test",
        metric="aligned",
        factor=factor,
    )


def median_error(found, truth) -> float:
    known = found > 0
    return float((found[known] / truth[known] - 1).abs().median())


def test_depth_is_the_truth_and_the_record_says_how(clip) -> None:
    found = align_clip(without_depth(clip), relative_disparity(clip), reference(clip))
    assert found.refused == ()
    assert median_error(found.clip.views[0].depth, clip.views[0].depth) < 1e-5
    scale = found.clip.note.scale
    assert (scale.disparity_scale, scale.disparity_shift) == pytest.approx((SCALE, SHIFT), rel=1e-4)
    assert scale.reference == "test"
    assert found.clip.note.metric == "aligned"


def test_translations_are_multiplied_and_never_shifted(clip) -> None:
    found = align_clip(clip, relative_disparity(clip), reference(clip, factor=2.5)).clip
    before = clip.views[0].cameras.world_from_camera
    after = found.views[0].cameras.world_from_camera
    torch.testing.assert_close(after[:, :3, 3], before[:, :3, 3] * 2.5)
    torch.testing.assert_close(after[:, :3, :3], before[:, :3, :3])
    assert after[0, :3, 3].abs().max() == 0


def test_limits_in_metres_do_not_apply_without_a_unit(clip) -> None:
    tiny = replace(reference(clip, factor=1e-3), metric="none")
    found = align_clip(without_depth(clip), relative_disparity(clip), tiny).clip
    assert median_error(found.views[0].depth * 1e3, clip.views[0].depth) < 1e-5


def test_infinitely_far_and_sky_pixels_have_no_depth(clip) -> None:
    disparity = relative_disparity(clip)
    disparity[:, 0] = 0
    sky = torch.zeros(clip.views[0].rgb.shape[:-1], dtype=torch.bool)
    sky[:, 1] = True
    seen = replace(clip, views=(replace(clip.views[0], sky=sky),))
    depth = align_clip(seen, disparity, reference(clip)).clip.views[0].depth
    assert (depth[:, :2] == 0).all()
    assert (depth[:, 2:] > 0).all()


def test_the_papers_method_is_an_option_by_name(clip) -> None:
    settings = AlignmentSettings(method="paper_depth_space")
    found = align_clip(clip, relative_disparity(clip), reference(clip), settings).clip
    assert found.note.scale.method.startswith("paper depth space, z = ")
    assert found.note.scale.disparity_scale is None
    assert median_error(found.views[0].depth, clip.views[0].depth) > 0.003


@pytest.mark.parametrize(
    ("damage", "reason"),
    [
        (
            lambda d: d * np.linspace(0.6, 1.4, len(d))[:, None, None].astype(np.float32),
            "scale over",
        ),
        (lambda d: np.random.default_rng(0).permuted(d, axis=None), "inliers"),
    ],
)
def test_gates_say_why_a_fit_is_refused(clip, damage, reason) -> None:
    found = align_clip(clip, damage(relative_disparity(clip)), reference(clip))
    assert any(each.startswith(reason) for each in found.refused)


def test_other_frames_than_the_clip_has_are_refused(clip) -> None:
    with pytest.raises(InputError, match="expected 7 frames like the clip"):
        align_clip(clip, relative_disparity(clip)[:5], reference(clip))


def test_megasam_without_its_normaliser_takes_the_scale_of_metric_poses(clip) -> None:
    ns = 3.7
    poses = clip.views[0].cameras.world_from_camera.numpy().copy()
    poses[:, :3, 3] *= ns
    scene = MegasamScene(
        depth=clip.views[0].depth.numpy() * np.float32(ns), world_from_camera=poses
    )
    found = megasam_reference(clip, scene, None)
    assert found.normaliser == pytest.approx(ns)
    np.testing.assert_allclose(found.depth, clip.views[0].depth.numpy(), rtol=1e-5)
    given = megasam_reference(clip, scene, ns)
    assert given.factor == pytest.approx(1)
    unknown = replace(clip, note=replace(clip.note, metric="none"))
    with pytest.raises(InputError, match="does not keep the normaliser"):
        megasam_reference(unknown, scene, None)


def test_poses_of_another_unit_follow_megasam(clip) -> None:
    poses = clip.views[0].cameras.world_from_camera.numpy().copy()
    scene = MegasamScene(depth=clip.views[0].depth.numpy(), world_from_camera=poses)
    found = megasam_reference(clip, scene, 2.0)
    assert found.factor == pytest.approx(0.5)
    np.testing.assert_allclose(found.depth, clip.views[0].depth.numpy() / 2)


def test_stereo_matching_gives_metric_depth() -> None:
    pair = textured_clip(frames=1, stereo=True)
    depth = torch.from_numpy(stereo_reference(pair).depth)
    assert (depth > 0).float().mean() > 0.5
    assert median_error(depth, pair.views[0].depth) < 0.02


def test_a_pair_that_is_not_rectified_is_refused() -> None:
    pair = textured_clip(frames=1, stereo=True)
    swapped = replace(pair, views=pair.views[::-1])
    with pytest.raises(InputError, match="expected a rectified pair"):
        stereo_reference(swapped)
    with pytest.raises(InputError, match="expected two views"):
        stereo_reference(replace(pair, views=pair.views[:1]))


def test_a_plain_video_gets_poses_and_depth_up_to_scale() -> None:
    clip = textured_clip(frames=7)
    lens = pinhole(110.0, clip.size_px, torch.float64)
    cameras = video_poses(clip.views[0].rgb.numpy(), lens)
    true = clip.views[0].cameras.position[1:]
    direction = cameras.position[1:] / cameras.position[1:].norm(dim=1, keepdim=True)
    assert (direction @ (true[-1] / true[-1].norm())).min() > 0.98
    factor = float(true[-1].norm() / cameras.position[-1].norm())
    view = replace(clip.views[0], cameras=cameras)
    depth = 1 / torch.from_numpy(flow_disparity(view)).clamp(min=1e-6)
    known = depth < 1e5
    assert known.float().mean() > 0.5
    assert median_error(depth[known] * factor, clip.views[0].depth[known]) < 0.1


def test_a_camera_that_does_not_move_has_no_poses() -> None:
    clip = textured_clip(frames=1)
    rgb = clip.views[0].rgb.numpy().repeat(3, 0)
    with pytest.raises(InputError, match="too little parallax"):
        video_poses(rgb, pinhole(110.0, clip.size_px, torch.float64))


def test_triangulated_points_have_the_depth_of_the_poses() -> None:
    clip = textured_clip(frames=6)
    depth = torch.from_numpy(triangulation_reference(without_depth(clip)).depth)
    assert (depth > 0).sum() > 200
    assert median_error(depth, clip.views[0].depth) < 0.03


def test_a_folder_is_aligned_and_bad_clips_become_rows(tmp_path) -> None:
    clips = [textured_clip(frames=7, identifier=name) for name in ("a", "b")]
    disparity = tmp_path / "vda"
    disparity.mkdir()
    np.savez(disparity / "a_depths.npz", depths=relative_disparity(clips[0]).astype(np.float16))
    (disparity / "b_depths.npz").write_bytes(b"PK\x03\x04 cut off")
    with ShardWriter(tmp_path / "in", ShardOptions(generator="test")) as writer:
        for clip in clips:
            writer.write(without_depth(clip))
    job = AlignJob(
        clips=tmp_path / "in",
        folder=tmp_path / "out",
        reference="triangulation",
        disparity=disparity,
    )
    rows = align_folder(job, Phases())
    assert [(row.clip, row.status, row.error) for row in rows] == [
        ("a", "written", ""),
        ("b", "failed", "FileFormatError"),
    ]
    stored = ClipFolder(tmp_path / "out").clip(0)
    assert stored.note.scale.reference == "triangulation"
    assert median_error(stored.views[0].depth, clips[0].views[0].depth) < 0.02
    assert [row.status for row in align_folder(job, Phases())] == ["present", "failed"]
