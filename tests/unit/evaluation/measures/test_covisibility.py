"""Which pixels the input shows: against loops over pixels, and on walls where it is plain."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from oracles_clips import make_clip
from oracles_covisibility import FLAT_DEPTH, FLAT_SIZE, flat_case, seen_by_loops, tracked, with_view
from oracles_evaluation import FRAMES, SIZE, Fixed, filmed, tiny_protocol, wall_and_patch

from diff4splat.evaluation.columns import SYSTEM
from diff4splat.evaluation.measure_item import Setup, measure_item
from diff4splat.evaluation.measures.covisibility import (
    covisible_masks,
    static_instances,
)
from diff4splat.evaluation.measures.hidden_classes import HiddenPixels, hidden_pixels
from diff4splat.evaluation.measures.regions import (
    KEYS,
    ComparedImages,
    TrueRegions,
    masked_psnr,
    region_entries,
)
from diff4splat.evaluation.protocols.protocol import Targets, Task
from diff4splat.evaluation.protocols.sample import EvalSample, make_sample
from diff4splat.evaluation.records import Score
from diff4splat.evaluation.systems.baselines import BEST_PLANE, MEAN_PLANE, NEAREST, ZERO_MOTION
from diff4splat.metrics.features.load import load_features


def made_case(task: Task, stride: int, **changes: object) -> EvalSample:
    protocol = replace(
        tiny_protocol(),
        input_stride=stride,
        reconstruction=Targets(pairs=((1, 1), (1, 3), (0, 3)), source_frames=(0,)),
    )
    return make_sample(replace(make_clip(FRAMES, SIZE, tracks=64), **changes), protocol, task)


def disoccluded(covisible: torch.Tensor) -> TrueRegions:
    """All that is not covisible is disoccluded."""
    none = torch.zeros_like(covisible)
    hidden = HiddenPixels(disoccluded=~covisible, disoccluded_by_motion=none, outside=none)
    return TrueRegions(covisible=covisible, hidden=hidden)


def region_values(images: ComparedImages) -> dict[str, float]:
    entries = region_entries("row", images, load_features())
    return {one.key: one.value for one in entries if isinstance(one, Score)}


def count(case: EvalSample) -> int:
    return int(covisible_masks(case).sum())


@pytest.mark.parametrize(
    ("task", "stride", "seed"),
    [
        ("generation", 1, 0),
        ("reconstruction", 1, 1),
        ("reconstruction", 2, 2),
        ("reconstruction", 4, 3),
    ],
)
def test_masks_are_those_of_loops_over_pixels(task: Task, stride: int, seed: int) -> None:
    made = make_clip(FRAMES, SIZE, seed=seed, tracks=64)
    case = made_case(task, stride, views=made.views, tracks=made.tracks)
    found = covisible_masks(case).numpy()
    assert np.array_equal(found, seen_by_loops(case))
    assert 0.1 < found.mean() < 0.95


def test_without_tracks_or_instances_everything_may_move() -> None:
    whole = made_case("reconstruction", 1)
    blind = made_case("reconstruction", 1, tracks=None)
    unnamed = with_view(with_view(whole, 0, instances=None), 1, instances=None)
    for case in (blind, unnamed):
        assert np.array_equal(covisible_masks(case).numpy(), seen_by_loops(case))
    assert not static_instances(blind.clip).any()
    assert count(blind) == count(unnamed) < count(whole)


@pytest.mark.parametrize("holed", [0, 1])
def test_everything_is_seen_from_the_same_place_except_for_sky(holed: int) -> None:
    case = flat_case()
    # A wall where a missing depth must not be taken for one.
    for view in (0, 1):
        case = with_view(case, view, depth=torch.ones_like(case.clip.views[view].depth))
    assert bool(covisible_masks(case).all())
    sky = case.clip.views[holed].depth.clone()
    sky[:, 0], sky[:, 1], sky[:, 2], sky[:, 3] = 0, math.nan, math.inf, -1
    seen = covisible_masks(with_view(case, holed, depth=sky))[0]
    assert not seen[:4].any()
    assert bool(seen[4:].all())


def test_a_camera_that_looks_away_shows_nothing() -> None:
    case = flat_case()
    turned = case.clip.views[0].cameras.world_from_camera * torch.tensor([-1.0, 1, -1, 1])
    away = case.clip.views[0].cameras.with_pose(turned)
    assert count(with_view(case, 0, cameras=away)) == 0


def test_what_lies_beside_the_image_is_not_seen() -> None:
    case = flat_case()
    poses = case.clip.views[0].cameras.world_from_camera.clone()
    # Three pixels to the right: 3 · 4 / 9.
    poses[:, 0, 3] = 3 * FLAT_DEPTH / 9
    seen = covisible_masks(with_view(case, 0, cameras=case.clip.views[0].cameras.with_pose(poses)))[
        0
    ]
    assert not seen[:, :3].any()
    assert bool(seen[:, 3:].all())


@pytest.mark.parametrize(("factor", "agrees"), [(0.94, False), (0.96, True), (1.04, True)])
def test_depths_agree_within_a_twentieth(factor: float, agrees: bool) -> None:
    case = flat_case()
    other = case.clip.views[1].depth * factor
    assert count(with_view(case, 1, depth=other)) == agrees * math.prod(FLAT_SIZE)
    behind = case.clip.views[1].depth * 1.06
    assert count(with_view(case, 1, depth=behind)) == 0


def test_without_any_depth_there_is_no_mask_and_a_sky_shows_nothing() -> None:
    case = flat_case()
    assert covisible_masks(replace(case, has_depth=False)) is None
    sky = torch.zeros_like(case.clip.views[1].depth)
    assert count(with_view(case, 1, depth=sky)) == 0
    assert count(with_view(case, 0, depth=sky)) == 0


def test_what_stands_is_looked_for_everywhere_and_what_moves_nearby() -> None:
    case = flat_case(pair=(1, 1))
    hidden = case.clip.views[0].depth.clone()
    hidden[:4] = FLAT_DEPTH / 2
    # Only the last given frame shows the wall.
    late = with_view(case, 0, depth=hidden)
    assert count(late) == math.prod(FLAT_SIZE)
    positions = torch.zeros(5, 2, 3)
    positions[3, 1, 0] = 0.005
    moving = replace(late, clip=replace(late.clip, tracks=tracked(positions, [1, 1])))
    assert count(moving) == 0
    near = replace(moving, targets=Targets(pairs=((1, 3),), source_frames=()))
    assert count(near) == math.prod(FLAT_SIZE)


def test_instances_stand_when_all_their_points_do() -> None:
    positions = torch.zeros(3, 6, 3)
    positions[2, 1, 1], positions[1, 2, 2], positions[1, 3, 0] = 0.005, 0.003, math.nan
    clip = replace(flat_case().clip, tracks=tracked(positions, [7, 7, 8, 9, 255, 0]))
    assert static_instances(clip).nonzero().flatten().tolist() == [8, 255]


def test_errors_outside_the_mask_do_not_count() -> None:
    truth = torch.full((1, 8, 8, 3), 0.5)
    rgb = truth.clone()
    rgb[:, :4] += 0.1
    rgb[:, 4:] = math.nan
    seen = torch.zeros(1, 8, 8, dtype=torch.bool)
    seen[:, :4] = True
    assert float(masked_psnr(rgb, truth, seen)) == pytest.approx(20, abs=1e-4)
    assert float(masked_psnr(truth, truth, seen)) == 100


def test_too_few_pixels_say_nothing() -> None:
    truth, seen = torch.zeros(2, 8, 8, 3), torch.zeros(2, 8, 8, dtype=torch.bool)
    seen[0].view(-1)[:15] = True
    seen[1].view(-1)[:16] = True
    found = masked_psnr(truth + 0.1, truth, seen)
    assert math.isnan(found[0])
    assert float(found[1]) == pytest.approx(20, abs=1e-4)


@pytest.mark.parametrize("task", ["generation", "reconstruction"])
def test_rows_that_show_images_have_it(task: Task) -> None:
    scene = wall_and_patch((0.3, -0.1, 0.2))
    setup = Setup(protocol=tiny_protocol(), task=task, system=Fixed(scene))
    clip = filmed(scene)
    result = measure_item(0, clip, setup)
    assert result.value(SYSTEM, "covisible_psnr") > 57
    share = result.value(SYSTEM, "covisible_share")
    assert 0.5 < share < 1
    for row in (NEAREST, BEST_PLANE, MEAN_PLANE):
        assert result.value(row, "covisible_share") == share
        assert 10 < result.value(row, "covisible_psnr") < 57
    assert result.value(ZERO_MOTION, "covisible_share") is None


def test_images_that_show_nothing_seen_are_left_out_and_lower_the_share() -> None:
    scene = wall_and_patch()
    clip = filmed(scene)
    depth = clip.views[1].depth.clone()
    depth[4] = 0
    clip = replace(clip, views=(clip.views[0], replace(clip.views[1], depth=depth)))
    setup = Setup(protocol=tiny_protocol(), task="reconstruction", system=Fixed(scene))
    scores = {s.key: s for s in measure_item(0, clip, setup).scores if s.row == SYSTEM}
    assert scores["covisible_psnr"].parts[1] is None
    assert scores["covisible_share"].parts[1] == 0
    assert scores["covisible_share"].value == pytest.approx(
        scores["covisible_share"].parts[0] / 2, abs=1e-6
    )


def test_clips_without_depth_are_counted() -> None:
    scene = wall_and_patch()
    clip = filmed(scene)
    views = tuple(replace(view, depth=torch.zeros_like(view.depth)) for view in clip.views)
    setup = Setup(protocol=tiny_protocol(), task="generation", system=Fixed(scene))
    result = measure_item(0, replace(clip, views=views), setup)
    why = {skip.key: skip.why for skip in result.skips if skip.row == SYSTEM}
    assert [why[key] for key in KEYS] == ["the clip has no depth"] * len(KEYS)


def test_hidden_pixels_have_a_surface_that_the_input_does_not_show() -> None:
    case = flat_case()
    covisible = covisible_masks(case)
    hidden = hidden_pixels(case, covisible).regions["hidden"]
    assert not (hidden & covisible).any()
    depth = torch.stack([case.true_depth(pair) for pair in case.targets.pairs])
    assert torch.equal(hidden | covisible, depth > 0)


def test_errors_of_seen_pixels_leave_the_hidden_ones_alone() -> None:
    truth = torch.rand(1, 16, 16, 3, generator=torch.Generator().manual_seed(0))
    covisible = torch.zeros(1, 16, 16, dtype=torch.bool)
    covisible[:, :8] = True
    rgb = torch.where(covisible[..., None], 1 - truth, truth)
    images = ComparedImages(rgb=rgb, truth=truth, regions=disoccluded(covisible))
    values = region_values(images)
    assert values["hidden_psnr"] == 100
    assert values["hidden_perceptual"] == pytest.approx(0, abs=1e-6)
    assert values["covisible_psnr"] < 20
    swapped = replace(images, regions=disoccluded(~covisible))
    values = region_values(swapped)
    assert values["hidden_psnr"] < 20 < values["covisible_psnr"]
    assert values["hidden_perceptual"] > 0.01
