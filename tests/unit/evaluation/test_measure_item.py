"""Exact answers on constructed scenes: a scene that is the truth, and baselines on planes."""

from dataclasses import replace

import pytest
import torch
from oracles_evaluation import (
    BACK,
    SIZE,
    Fixed,
    as_scene,
    filmed,
    slab,
    tiny_protocol,
    view_cameras,
    wall_and_patch,
)

from diff4splat.evaluation.columns import SYSTEM
from diff4splat.evaluation.measure_item import Setup, measure_item
from diff4splat.evaluation.measures.scenes import moving_share
from diff4splat.evaluation.measures.tracks import tracked_points
from diff4splat.evaluation.protocols.protocol import Task
from diff4splat.evaluation.protocols.sample import make_sample
from diff4splat.evaluation.records import ItemResult
from diff4splat.evaluation.systems.baselines import (
    BEST_PLANE,
    MEAN_PLANE,
    NEAREST,
    ZERO_MOTION,
    best_depth,
    make_baseline,
    mean_depth,
)
from diff4splat.evaluation.systems.predictions import scene_flow
from diff4splat.scene.motion.static import StaticMotion

SHIFT = (0.3, -0.1, 0.2)


@pytest.fixture(scope="module")
def moving() -> ItemResult:
    return measure("generation", wall_and_patch(SHIFT))


def measure(task: Task, scene, answer=None) -> ItemResult:
    setup = Setup(protocol=tiny_protocol(), task=task, system=Fixed(answer or scene))
    return measure_item(0, filmed(scene, still=isinstance(scene.motion, StaticMotion)), setup)


def test_the_truth_itself_is_near_perfect(moving: ItemResult) -> None:
    # Images in 8 bits are 58.9 dB from what they were rounded from.
    assert moving.value(SYSTEM, "psnr") > 57
    assert moving.value(SYSTEM, "ssim") > 0.999
    assert moving.value(SYSTEM, "depth_pearson") == pytest.approx(1, abs=1e-5)
    assert moving.value(SYSTEM, "depth_absrel") == pytest.approx(0, abs=1e-5)
    # Pixels at silhouettes show both surfaces, and their flow is the mean of both.
    assert moving.value(SYSTEM, "track_error") < 3e-3
    assert moving.value(SYSTEM, "track_ratio") < 0.01


def test_inside_a_silhouette_scene_flow_is_that_of_the_surface() -> None:
    scene = wall_and_patch(SHIFT)
    flow = scene_flow(scene, view_cameras(0)[0], 0.0, (0.5, 1.0))
    assert flow.shape == (2, *SIZE, 3)
    shift = torch.tensor(SHIFT)
    # Between Gaussians a hundredth of the wall shines through.
    assert torch.allclose(flow[0, 16, 20], shift / 2, rtol=0.02)
    assert torch.allclose(flow[1, 16, 20], shift, rtol=0.02)
    assert torch.allclose(flow[:, 3, 3], torch.zeros(2, 3), atol=1e-6)


def test_scene_flow_starts_where_things_are_at_the_source_time() -> None:
    scene = wall_and_patch((2.0, 0.0, 0.0))
    flow = scene_flow(scene, view_cameras(0)[0], 1.0, (0.0,))
    assert float(flow[0, 16, 20, 0]) == pytest.approx(0, abs=1e-4), "the patch has left"
    # At its end the patch is around x = 0.9 at depth 3: 12 px to the right of the middle.
    near = scene_flow(wall_and_patch((0.9, 0.0, 0.0)), view_cameras(0)[0], 1.0, (0.0,))
    assert float(near[0, 16, 32, 0]) == pytest.approx(-0.9, rel=0.02)


def test_pixels_that_show_nothing_stand_still() -> None:
    patch = wall_and_patch(SHIFT)
    alone = patch.select(torch.arange(len(patch.gaussians)) >= patch.motion.moving_index[0])
    flow = scene_flow(alone, view_cameras(0)[0], 0.0, (1.0,))
    assert bool(torch.isfinite(flow).all())
    assert not bool(flow[0, 2, 2].any())


def test_standing_still_has_a_ratio_of_one(moving: ItemResult) -> None:
    assert moving.value(ZERO_MOTION, "track_ratio") == 1
    assert moving.value(ZERO_MOTION, "track_error") > 10 * moving.value(SYSTEM, "track_error")
    assert moving.value(ZERO_MOTION, "psnr") is None
    still = measure("generation", wall_and_patch(SHIFT), wall_and_patch())
    assert still.value(SYSTEM, "track_ratio") == 1


def test_moving_the_wrong_way_is_worse_than_standing_still() -> None:
    wrong = measure("generation", wall_and_patch(SHIFT), wall_and_patch((-0.3, 0.1, -0.2)))
    assert wrong.value(SYSTEM, "track_ratio") == pytest.approx(2, abs=0.02)
    half = measure("generation", wall_and_patch(SHIFT), wall_and_patch((0.15, -0.05, 0.1)))
    assert half.value(SYSTEM, "track_ratio") == pytest.approx(0.5, abs=0.02)


def test_tracks_are_followed_from_later_frames_too() -> None:
    whole = measure("reconstruction", wall_and_patch(SHIFT))
    assert whole.value(SYSTEM, "track_ratio") < 0.02
    assert whole.value(SYSTEM, "psnr") > 57


def test_still_clips_are_asked_whether_they_stand_and_close() -> None:
    still = measure("generation", wall_and_patch())
    assert still.value(SYSTEM, "moving_share") == 0
    assert still.value(SYSTEM, "loop_psnr") == 100
    assert still.value(SYSTEM, "track_ratio") is None
    drifting = measure("generation", wall_and_patch(), wall_and_patch((1.0, 0, 0)))
    scene = wall_and_patch((1.0, 0, 0))
    share = len(scene.motion.moving_index) / len(scene.gaussians)
    assert drifting.value(SYSTEM, "moving_share") == pytest.approx(share, abs=1e-5)
    assert drifting.value(SYSTEM, "loop_psnr") < 40


def test_a_moving_clip_says_why_it_is_not_asked(moving: ItemResult) -> None:
    reasons = {(skip.key, skip.why) for skip in moving.skips if skip.row == SYSTEM}
    assert ("moving_share", "objects move in the clip") in reasons
    assert moving.value(SYSTEM, "moving_share") is None


def test_a_plane_is_perfect_on_a_planar_clip() -> None:
    wall = as_scene(slab(BACK, (4.0, 3.2), 0.16, 1), StaticMotion())
    result = measure("generation", wall)
    for row in (BEST_PLANE, MEAN_PLANE):
        assert result.value(row, "psnr") > result.value(NEAREST, "psnr") + 5
        assert result.value(row, "depth_absrel") < 1e-4
    case = make_sample(filmed(wall), tiny_protocol(), "generation")
    assert best_depth(case, tiny_protocol().planes) == pytest.approx(BACK, rel=1e-4)


def test_the_best_plane_is_at_least_as_good_as_every_candidate(moving: ItemResult) -> None:
    case = make_sample(filmed(wall_and_patch(SHIFT)), tiny_protocol(), "generation")
    one = replace(tiny_protocol().planes, candidates=1, nearest=1.0, farthest=1.0)
    assert best_depth(case, one) == pytest.approx(4.0, rel=1e-6)
    assert moving.value(BEST_PLANE, "psnr") >= moving.value(MEAN_PLANE, "psnr") - 0.2


def test_reconstruction_gets_the_frame_nearest_in_time() -> None:
    case = make_sample(filmed(wall_and_patch(SHIFT)), tiny_protocol(), "reconstruction")
    answer = make_baseline(NEAREST, case, tiny_protocol().planes)
    assert torch.equal(answer.render(case.camera((1, 3)), 0.75, 3).rgb, case.input_rgb(3))
    first = make_sample(filmed(wall_and_patch(SHIFT)), tiny_protocol(), "generation")
    shown = make_baseline(NEAREST, first, tiny_protocol().planes).render(
        first.camera((1, 3)), 0.75, 3
    )
    assert torch.equal(shown.rgb, first.input_rgb(0))
    assert shown.depth is None


@pytest.mark.parametrize("row", [NEAREST, MEAN_PLANE])
def test_baselines_are_given_no_more_frames_than_the_system(row: str) -> None:
    protocol = replace(tiny_protocol(), input_stride=2)
    case = make_sample(filmed(wall_and_patch(SHIFT)), protocol, "reconstruction")
    seen = make_baseline(row, case, protocol.planes).render(case.camera((1, 3)), 0.75, 3)
    hidden = case.input_view.rgb.clone()
    hidden[[1, 3]] = 0
    views = (replace(case.input_view, rgb=hidden), *case.clip.views[1:])
    blind = replace(case, clip=replace(case.clip, views=views))
    again = make_baseline(row, blind, protocol.planes).render(case.camera((1, 3)), 0.75, 3)
    assert torch.equal(seen.rgb, again.rgb)
    if row == NEAREST:
        assert torch.equal(seen.rgb, case.input_rgb(2))


def test_without_depth_images_are_judged_and_the_rest_is_counted() -> None:
    clip = filmed(wall_and_patch(SHIFT))
    views = tuple(replace(view, depth=torch.zeros_like(view.depth)) for view in clip.views)
    setup = Setup(protocol=tiny_protocol(), task="generation", system=Fixed(wall_and_patch(SHIFT)))
    result = measure_item(0, replace(clip, views=views), setup)
    assert result.value(SYSTEM, "psnr") > 57
    skipped = {(skip.row, skip.key) for skip in result.skips}
    assert {(SYSTEM, "depth_absrel"), (SYSTEM, "track_error"), (MEAN_PLANE, "psnr")} <= skipped


def test_without_tracks_their_columns_are_counted_as_skipped() -> None:
    clip = replace(filmed(wall_and_patch(SHIFT)), tracks=None)
    setup = Setup(protocol=tiny_protocol(), task="generation", system=Fixed(wall_and_patch(SHIFT)))
    result = measure_item(0, clip, setup)
    assert result.value(SYSTEM, "track_error") is None
    assert any(skip.key == "track_error" for skip in result.skips)


def test_flow_does_not_fade_with_the_surface() -> None:
    patch = wall_and_patch(SHIFT)
    alone = patch.select(torch.arange(len(patch.gaussians)) >= patch.motion.moving_index[0])
    faint = replace(alone.gaussians, opacities=torch.full((len(alone.gaussians),), 0.1))
    flow = scene_flow(replace(alone, gaussians=faint), view_cameras(0)[0], 0.0, (1.0,))
    assert torch.allclose(flow[0, 16, 20], torch.tensor(SHIFT), atol=1e-5)


def test_a_shadow_does_not_move_the_ground_that_it_slides_over() -> None:
    scene = wall_and_patch(SHIFT)
    faint = scene.gaussians.opacities.clone()
    faint[scene.motion.moving_index] = 0.5
    shadow = replace(scene, gaussians=replace(scene.gaussians, opacities=faint))
    flow = scene_flow(shadow, view_cameras(0)[0], 0.0, (1.0,))
    assert float(flow[0, 16, 20].norm()) < 0.01 * float(torch.tensor(SHIFT).norm())


def test_points_at_pixels_that_show_another_object_are_not_followed() -> None:
    clip = filmed(wall_and_patch(SHIFT))
    case = make_sample(clip, tiny_protocol(), "generation")
    found = tracked_points(case, tiny_protocol())[0]
    count = int(clip.views[0].track_visible[0].sum())
    assert 0 < len(found.query.cells) <= count
    wrong = torch.full_like(clip.tracks.instances, 3)
    nobody = replace(case.clip, tracks=replace(case.clip.tracks, instances=wrong))
    assert tracked_points(replace(case, clip=nobody), tiny_protocol()) == []


def test_a_gaussian_moves_when_the_input_camera_can_tell() -> None:
    camera = view_cameras(0)[0]
    times_s = torch.linspace(0, 1, 3)
    # 40 px · 0.06 / 3 = 0.8 px at the patch.
    scene = wall_and_patch((0.06, 0, 0))
    share = len(scene.motion.moving_index) / len(scene.gaussians)
    assert moving_share(scene, camera, times_s, 0.75) == pytest.approx(share)
    assert moving_share(scene, camera, times_s, 0.85) == 0


def test_the_mean_plane_stands_at_the_mean() -> None:
    case = make_sample(filmed(wall_and_patch()), tiny_protocol(), "generation")
    wanted = float(case.input_view.depth[0].mean())
    assert wanted < BACK - 0.01
    assert mean_depth(case) == pytest.approx(wanted, rel=1e-5)
