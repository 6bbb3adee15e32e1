"""Objects that move whole, torn, or not at all, where the answer is known."""

from dataclasses import replace

import pytest
import torch
from oracles_evaluation import SIZE, filmed, tiny_protocol, wall_and_patch

from diff4splat.evaluation.measures.object_parts import (
    eroded,
    is_torn,
    largest_part_share,
    part_labels,
)
from diff4splat.evaluation.measures.objects import (
    asked_entries,
    image_displacement,
    mask_iou,
    moves_most,
    object_entries,
    object_masks,
)
from diff4splat.evaluation.protocols.sample import EvalSample, make_sample
from diff4splat.evaluation.records import Score, Skip
from diff4splat.scene.scene import Scene

SHIFT = (0.9, 0.0, 0.0)
STILL_PX = 0.5


def sample() -> EvalSample:
    return make_sample(filmed(wall_and_patch(SHIFT)), tiny_protocol(), "generation")


def half_left_behind() -> Scene:
    """The patch of which only the upper half moves."""
    scene = wall_and_patch(SHIFT)
    rows = scene.gaussians.means[scene.motion.moving_index, 1]
    offsets = torch.where((rows < 0)[None, :, None], scene.motion.offsets, 0.0)
    return replace(scene, motion=replace(scene.motion, offsets=offsets))


def values(scene: Scene) -> dict[str, float | None]:
    entries = object_entries("row", sample(), scene, STILL_PX)
    return {one.key: one.value if isinstance(one, Score) else None for one in entries}


def test_the_truth_moves_its_object_whole() -> None:
    found = values(wall_and_patch(SHIFT))
    # Its silhouette is half wall, and moves as well.
    assert found["object_iou"] > 0.7
    assert found["object_torn"] == 0


def test_what_is_half_left_behind_is_torn() -> None:
    found = values(half_left_behind())
    assert found["object_iou"] < 0.6
    assert found["object_torn"] == 1


def test_what_does_not_move_overlaps_with_nothing_and_cannot_be_torn() -> None:
    assert values(wall_and_patch()) == {"object_iou": 0, "object_torn": None}


def test_what_moves_everything_overlaps_by_the_share_of_the_object() -> None:
    case = sample()
    (mask,) = [mask for note, mask in object_masks(case) if note.motion]
    everything = torch.full((*SIZE, 2), 3.0)
    entries = asked_entries("row", everything, [mask], STILL_PX)
    assert entries[0].value == pytest.approx(float(mask.double().mean()), abs=1e-6)
    assert entries[1].value == 0


def test_parts_of_one_object_are_measured_together() -> None:
    case = sample()
    parts = tuple(replace(note, object_number=7) for note in case.clip.note.objects)
    whole = replace(case, clip=replace(case.clip, note=replace(case.clip.note, objects=parts)))
    assert len(object_masks(case)) == 2
    ((note, mask),) = object_masks(whole)
    assert note == parts[0]
    assert torch.equal(mask, torch.stack([one for _, one in object_masks(case)]).any(0))


def test_displacement_is_in_pixels_of_the_first_camera() -> None:
    displacement = image_displacement(wall_and_patch((0.3, 0.0, 0.0)), sample())
    # 40 px · 0.3 / 3.
    assert displacement[16, 20].tolist() == pytest.approx([4, 0], abs=0.15)
    assert displacement[3, 3].tolist() == pytest.approx([0, 0], abs=1e-3)


def test_a_clip_in_which_nothing_is_asked_to_move_is_not_measured() -> None:
    case = sample()
    notes = tuple(replace(note, motion="") for note in case.clip.note.objects)
    clip = replace(case.clip, note=replace(case.clip.note, objects=notes))
    entries = object_entries("row", replace(case, clip=clip), wall_and_patch(), STILL_PX)
    assert all(isinstance(one, Skip) for one in entries)


def disc() -> torch.Tensor:
    rows, columns = torch.meshgrid(torch.arange(32), torch.arange(32), indexing="ij")
    return (rows - 16) ** 2 + (columns - 16) ** 2 < 100


def turned(angle: float) -> torch.Tensor:
    """Displacement of a rotation of the image around its centre."""
    rows, columns = torch.meshgrid(torch.arange(32.0), torch.arange(32.0), indexing="ij")
    offsets = torch.stack([columns - 16, rows - 16], -1)
    cos, sin = torch.tensor(angle).cos(), torch.tensor(angle).sin()
    return offsets @ torch.stack([torch.stack([cos, sin]), torch.stack([-sin, cos])]) - offsets


@pytest.mark.parametrize("angle", [0.0, 0.2, 0.45, 1.0, 3.0])
def test_what_turns_stays_whole(angle: float) -> None:
    assert not is_torn(turned(angle), disc())


def test_two_halves_that_move_apart_are_torn() -> None:
    displacement = torch.zeros(32, 32, 2)
    displacement[:, 16:, 0] = 2
    displacement[:, :16, 0] = -2
    assert largest_part_share(displacement, disc()) == pytest.approx(0.5, abs=0.05)
    assert is_torn(displacement, disc())


@pytest.mark.parametrize("apart", [0.6, 1.0, 2.0, 4.0, 20.0])
@pytest.mark.parametrize("angle", [0.0, 1.0])
def test_what_turns_and_moves_apart_is_torn(angle: float, apart: float) -> None:
    displacement = turned(angle)
    displacement[:, 16:, 0] += apart
    assert is_torn(displacement, disc())
    displacement[:, :8, 1] += 30
    assert is_torn(displacement, disc())


@pytest.mark.parametrize("factor", [0.2, 1.0])
def test_what_grows_or_is_sheared_stays_whole(factor: float) -> None:
    rows, columns = torch.meshgrid(torch.arange(32.0), torch.arange(32.0), indexing="ij")
    grown = factor * torch.stack([columns - 16, rows - 28], -1)
    assert not is_torn(grown, disc())
    assert not is_torn(torch.stack([factor * rows, 0 * rows], -1), disc())


def test_one_pixel_and_one_row_have_an_affine_map() -> None:
    for size in (1, 6):
        mask = torch.zeros(8, 8, dtype=torch.bool)
        mask[2, :size] = True
        displacement = 3 * torch.arange(8.0)[None, :, None].expand(8, 8, 2)
        assert largest_part_share(displacement, mask) == 1


def test_a_small_rest_is_no_tear() -> None:
    displacement = torch.zeros(32, 32, 2)
    displacement[:9, :, 0] = 5
    assert 0.9 < largest_part_share(displacement, disc()) < 1
    assert not is_torn(displacement, disc())


def test_an_object_behind_a_pole_is_not_torn() -> None:
    mask = disc()
    mask[:, 15:18] = False
    assert not is_torn(torch.full((32, 32, 2), 3.0), mask)
    assert len(part_labels(torch.zeros(32, 32, 2), mask)[mask].unique()) == 2


def test_parts_are_found_along_any_way() -> None:
    mask = torch.zeros(9, 9, dtype=torch.bool)
    mask[::2] = True
    mask[1, 8] = mask[3, 0] = mask[5, 8] = mask[7, 0] = True
    assert len(part_labels(torch.zeros(9, 9, 2), mask)[mask].unique()) == 1


def test_empty_objects_are_whole() -> None:
    none = torch.zeros(4, 4, dtype=torch.bool)
    assert largest_part_share(torch.zeros(4, 4, 2), none) == 1
    assert not bool(eroded(torch.ones(2, 2, dtype=torch.bool)).logical_not().any())
    assert mask_iou(none, none) == 1


def test_the_named_object_must_move_most() -> None:
    displacement = torch.zeros(8, 8, 2)
    displacement[:4, :, 0], displacement[4:, :, 0] = 3, 1
    upper = torch.zeros(8, 8, dtype=torch.bool)
    upper[:4] = True
    assert moves_most(displacement, [upper, ~upper], 0, STILL_PX)
    assert not moves_most(displacement, [upper, ~upper], 1, STILL_PX)
    assert not moves_most(torch.zeros(8, 8, 2), [upper, ~upper], 0, STILL_PX)
