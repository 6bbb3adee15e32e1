"""Text direction on scenes with known motion."""

from dataclasses import replace

import pytest
import torch
from oracles_evaluation import Fixed, filmed, tiny_protocol, wall_and_patch

from diff4splat.data.clip import Clip
from diff4splat.errors import ConfigError
from diff4splat.evaluation.columns import SYSTEM
from diff4splat.evaluation.measure_item import Setup, measure_item
from diff4splat.evaluation.measures.text import mean_rightward_flow, plain_caption, text_sample
from diff4splat.evaluation.protocols.sample import make_sample
from diff4splat.evaluation.records import ItemResult
from diff4splat.evaluation.systems.baselines import ZERO_MOTION
from diff4splat.scene.scene import Scene

RIGHT, LEFT = (0.3, 0.0, 0.0), (-0.3, 0.0, 0.0)


@pytest.fixture(scope="module")
def clip() -> Clip:
    return filmed(wall_and_patch(RIGHT))


def measure(clip: Clip, told) -> ItemResult:
    setup = Setup(protocol=tiny_protocol(), task="text", system=Fixed(wall_and_patch(), told))
    return measure_item(0, clip, setup)


def obedient(caption: str) -> Scene:
    return wall_and_patch(LEFT if "left" in caption else RIGHT if "right" in caption else (0, 0, 0))


def values(result: ItemResult) -> tuple[float | None, ...]:
    return tuple(result.value(SYSTEM, key) for key in ("text_right", "text_both", "text_still"))


def test_a_system_that_obeys_is_right(clip: Clip) -> None:
    assert values(measure(clip, obedient)) == (1, 1, 1)


def test_ignoring_the_text_is_half_right_and_never_both(clip: Clip) -> None:
    right, both, still = values(measure(clip, lambda caption: wall_and_patch(RIGHT)))
    assert (right, both) == (0.5, 0)
    assert 0 < still < 1


def test_the_opposite_and_standing_still_are_never_right(clip: Clip) -> None:
    swapped = {"left": RIGHT, "right": LEFT}

    def contrary(caption: str) -> Scene:
        return wall_and_patch(swapped.get(caption.rsplit(maxsplit=1)[-1], (0, 0, 0)))

    assert values(measure(clip, contrary)) == (0, 0, 1)
    result = measure(clip, lambda caption: wall_and_patch())
    assert values(result) == (0, 0, 1)
    assert result.value(ZERO_MOTION, "text_still") == 1


def test_the_flow_is_that_of_the_named_object(clip: Clip) -> None:
    found = text_sample(make_sample(clip, tiny_protocol(), "text"))
    assert found.note.name == "patch", "the moving object, though the wall is larger"
    assert mean_rightward_flow(wall_and_patch(RIGHT), found) == pytest.approx(0.3, abs=0.04)
    assert mean_rightward_flow(wall_and_patch((0.0, 0.5, 0.5)), found) == pytest.approx(0, abs=1e-6)


def test_captions_name_the_object_and_the_side(clip: Clip) -> None:
    note = clip.note.objects[1]
    assert plain_caption(clip, note, "left") == "the red patch moves to the left"
    assert plain_caption(clip, replace(note, color=""), "right") == "the patch moves to the right"
    assert plain_caption(clip, note, "still") == "nothing moves"


@pytest.mark.parametrize("blank", ["objects", "instances"])
def test_without_a_named_object_the_case_is_skipped(clip: Clip, blank: str) -> None:
    if blank == "objects":
        clip = replace(clip, note=replace(clip.note, objects=()))
    else:
        clip = replace(clip, views=tuple(replace(view, instances=None) for view in clip.views))
    result = measure(clip, obedient)
    assert result.scores == ()
    assert {skip.key for skip in result.skips} == {"text_right", "text_both", "text_still"}


def test_a_system_that_reads_no_captions_is_refused() -> None:
    class Deaf:
        identity = None

        def predict(self, case: object, seed: int) -> None:
            return None

    with pytest.raises(ConfigError, match="expected a system that reads captions"):
        Setup(protocol=tiny_protocol(), task="text", system=Deaf())


def test_chance_is_a_half() -> None:
    generator = torch.Generator().manual_seed(0)
    sides = torch.randint(2, (400, 2), generator=generator).bool()
    assert float((sides == torch.tensor([True, False])).double().mean()) == pytest.approx(
        0.5, abs=0.06
    )


def test_the_named_object_is_the_right_one_and_whole(clip: Clip) -> None:
    result = measure(clip, obedient)
    assert result.value(SYSTEM, "text_object") == 1
    assert result.value(SYSTEM, "object_iou") > 0.75
    assert result.value(SYSTEM, "object_torn") == 0
    still = measure(clip, lambda caption: wall_and_patch())
    assert still.value(SYSTEM, "text_object") == 0
    assert still.value(SYSTEM, "object_iou") == 0
    assert still.value(SYSTEM, "object_torn") is None


def test_with_one_named_object_none_could_be_mistaken_for_it(clip: Clip) -> None:
    one = replace(clip, note=replace(clip.note, objects=clip.note.objects[1:]))
    result = measure(one, obedient)
    assert result.value(SYSTEM, "text_object") is None
    assert any(skip.key == "text_object" for skip in result.skips)


def test_free_sentences_are_obeyed_like_plain_ones(clip: Clip) -> None:
    result = measure(clip, obedient)
    assert result.value(SYSTEM, "text_free") == 1
    # It moves the patch whatever is named.
    assert result.value(SYSTEM, "text_absent") == 0


def test_a_system_that_knows_names_moves_nothing_for_others(clip: Clip) -> None:
    def careful(caption: str) -> Scene:
        return obedient(caption) if "patch" in caption else wall_and_patch()

    result = measure(clip, careful)
    assert (result.value(SYSTEM, "text_free"), result.value(SYSTEM, "text_absent")) == (1, 1)


def test_a_system_that_reads_plain_sentences_alone_fails_at_free_ones(clip: Clip) -> None:
    def plain(caption: str) -> Scene:
        return obedient(caption) if caption.startswith("the red patch") else wall_and_patch()

    result = measure(clip, plain)
    assert result.value(SYSTEM, "text_right") == 1
    assert result.value(SYSTEM, "text_free") == 0
