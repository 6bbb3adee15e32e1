"""What hides a pixel: a wall and a patch before it, where geometry gives the answer."""

from dataclasses import replace

import pytest
import torch
from oracles_clips import make_clip
from oracles_covisibility import flat_case, tracked, with_view
from oracles_evaluation import FRAMES, SIZE, filmed, tiny_protocol, wall_and_patch

from diff4splat.evaluation.measures.covisibility import covisible_masks
from diff4splat.evaluation.measures.hidden_classes import CLASSES, HiddenPixels, hidden_pixels
from diff4splat.evaluation.measures.moved_points import moving_instances, points_at
from diff4splat.evaluation.protocols.protocol import Pair, Targets
from diff4splat.evaluation.protocols.sample import EvalSample, make_sample

PATCH = 2


def case_of(shift: tuple[float, float, float], pair: Pair) -> EvalSample:
    protocol = replace(tiny_protocol(), generation=Targets(pairs=(pair,), source_frames=(0,)))
    clip = filmed(wall_and_patch(shift), still=not any(shift))
    return make_sample(clip, protocol, "generation")


def classes(case: EvalSample) -> HiddenPixels:
    return hidden_pixels(case, covisible_masks(case))


def test_behind_where_an_object_was_pixels_are_uncovered() -> None:
    found = classes(case_of((0.9, 0.0, 0.0), (0, 4)))
    # Wall points from x = -0.8 were behind the patch; it now covers those from x = 0.36 on.
    assert bool(found.disoccluded_by_motion[0, 16, 14:21].all())
    assert not bool(found.disoccluded_by_motion[0, :, 26:].any())
    assert not bool(found.disoccluded_by_motion[0, :7].any())


def test_an_object_that_moved_is_not_hidden_where_it_is_now() -> None:
    case = case_of((0.9, 0.0, 0.0), (0, 4))
    patch = case.clip.views[0].instances[4] == PATCH
    hidden = classes(case).regions["hidden"][0]
    assert int(patch.sum()) > 100
    # Only its silhouette is mixed with the wall.
    assert int((hidden & patch).sum()) < 0.15 * int(patch.sum())
    assert int((~covisible_masks(case)[0] & patch).sum()) > 0.3 * int(patch.sum())


def test_the_camera_uncovers_what_was_behind_a_static_object() -> None:
    found = classes(case_of((0.0, 0.0, 0.0), (1, 4)))
    assert not bool(found.disoccluded_by_motion.any())
    # Wall points from x = 0.7 to 0.9, right beside the patch with its footprints.
    assert bool(found.disoccluded[0, 14:18, 24].all())
    assert not bool(found.disoccluded[0, :, 8:20].any())


def test_outside_is_what_the_first_image_did_not_reach() -> None:
    found = classes(case_of((0.0, 0.0, 0.0), (0, 4)))
    # The camera moved by 0.12 before a wall at depth 4: 1.2 px of 40.
    assert bool(found.outside[0, :, 39].all())
    assert not bool(found.outside[0, :, :38].any())


@pytest.mark.parametrize("shift", [(0.0, 0.0, 0.0), (0.9, 0.1, 0.0), (0.0, 0.0, -1.0)])
def test_classes_exclude_each_other_and_what_is_seen(shift: tuple[float, float, float]) -> None:
    case = case_of(shift, (1, 4))
    covisible = covisible_masks(case)
    found = hidden_pixels(case, covisible)
    counts = sum(getattr(found, name).int() for name in CLASSES)
    assert int(counts.max()) <= 1
    assert not bool((found.regions["hidden"] & covisible).any())


def test_a_pixel_without_depth_is_in_no_class() -> None:
    case = flat_case(given=(0,), pair=(1, 1))
    depth = case.clip.views[1].depth.clone()
    depth[1, 2, 3] = 0
    found = classes(with_view(case, 1, depth=depth))
    assert not bool(found.regions["hidden"][0, 2, 3])


def test_without_tracks_surfaces_stay_where_they_are() -> None:
    case = case_of((0.9, 0.0, 0.0), (0, 4))
    untracked = replace(case, clip=replace(case.clip, tracks=None))
    patch = case.clip.views[0].instances[4] == PATCH
    found = classes(untracked)
    assert not bool(found.disoccluded_by_motion.any())
    assert int((found.regions["hidden"][0] & patch).sum()) > 0.3 * int(patch.sum())


def test_points_turn_with_their_object() -> None:
    generator = torch.Generator().manual_seed(1)
    before = torch.rand(20, 3, generator=generator).double()
    turn = torch.linalg.matrix_exp(
        torch.tensor([[0, 0.4, 0.9], [-0.4, 0, -0.3], [-0.9, 0.3, 0]], dtype=torch.float64)
    )
    after = before @ turn.mT + torch.tensor([0.5, -1.0, 2.0])
    flat = flat_case()
    positions = torch.stack([before, after])
    clip = replace(flat.clip, tracks=tracked(positions, [7] * 20))
    points = torch.rand(5, 3, generator=generator).double()
    wanted = points @ turn.mT + torch.tensor([0.5, -1.0, 2.0])
    instances = torch.full((5,), 7)
    assert torch.allclose(points_at(clip, points, instances, (0, 1)), wanted, atol=1e-9)
    back = points_at(clip, wanted, instances, (1, 0))
    assert torch.allclose(back, points, atol=1e-9)
    assert torch.equal(points_at(clip, points, torch.full((5,), 8), (0, 1)), points)


def test_of_one_or_two_tracked_points_only_the_displacement_counts() -> None:
    flat = flat_case()
    positions = torch.zeros(2, 2, 3)
    positions[1] = torch.tensor([1.0, 2.0, 3.0])
    clip = replace(flat.clip, tracks=tracked(positions, [7, 7]))
    moved = points_at(clip, torch.zeros(1, 3), torch.tensor([7]), (0, 1))
    assert moved.tolist() == [[1.0, 2.0, 3.0]]


def test_an_instance_moves_if_one_of_its_points_does() -> None:
    positions = torch.zeros(3, 4, 3)
    positions[2, 1] = 0.5
    clip = replace(flat_case().clip, tracks=tracked(positions, [1, 2, 2, 0]))
    assert moving_instances(clip).nonzero()[:, 0].tolist() == [2]


def test_shares_are_of_the_whole_image() -> None:
    case = make_sample(make_clip(FRAMES, SIZE, tracks=64), tiny_protocol(), "generation")
    hidden = classes(case).regions["hidden"]
    assert hidden.shape == (4, *SIZE)
    assert 0 < float(hidden.double().mean()) < 0.7
