"""Folders of variants: links, steps by time, and stages that must not be taken for others."""

import json
from pathlib import Path

import pytest
import torch
from ablations import course
from ablations.clock import EVENT
from ablations.course import Lab, is_finished, link, require_autoencoder, train_variant
from ablations.variants import FULL, VARIANTS, Variant, recipe_of, reduced, with_steps

from diff4splat.configs.recipes import recipe_by_name
from diff4splat.errors import ConfigError
from diff4splat.training.latent_statistics import write_statistics
from diff4splat.training.recipe.recipe import Recipe
from diff4splat.training.recipe.recipe_json import recipe_to_json
from diff4splat.training.train_stage import RECIPE_FILE, StageRequest
from diff4splat.training.trainer.gates import StoredResult, write_result
from diff4splat.training.trainer.logs.run_files import EventLog
from diff4splat.training.trainer.settings import StageResult

STEPS = {"static-low": 30, "motion": 20, "dynamic": 50}
STEP_S = {"static-low": 1.0, "motion": 0.5, "dynamic": 2.0}
BASE = reduced(recipe_by_name("small"), STEPS)


def begun(folder: Path, finished: bool, recipe: Recipe = BASE) -> Path:
    """A stage folder as the trainer leaves it, as far as it is looked at here."""
    folder.mkdir(parents=True)
    (folder / RECIPE_FILE).write_text(recipe_to_json(recipe))
    result = StoredResult(
        stage=folder.name, finished=finished, step=1, checkpoint="none", measures={}
    )
    write_result(folder, result)
    return folder


def trained_at_once(asked: StageRequest) -> StageResult:
    """What training leaves behind, with seconds made up here."""
    count = asked.stop_after_steps or asked.recipe.stage(asked.stage).steps
    folder = begun(asked.folder / asked.stage, asked.stop_after_steps is None, asked.recipe)
    for step in range(count):
        EventLog(folder).write(EVENT, step, {"seconds": STEP_S[asked.stage]})
    return StageResult(
        stage=asked.stage, outcome="finished", step=count, measures={}, checkpoint=folder
    )


@pytest.fixture
def lab(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Lab:
    """With the full variant trained."""
    monkeypatch.setattr(course, "train_stage", trained_at_once)
    autoencoder = begun(tmp_path / "run" / "vae", finished=True)
    lab = Lab(base=BASE, autoencoder=autoencoder, out=tmp_path / "out", note=lambda text: None)
    train_variant(FULL, lab)
    return lab


def variant(name: str) -> Variant:
    return next(one for one in VARIANTS if one.name == name)


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("full", [("static-low", 30, False), ("motion", 20, False), ("dynamic", 50, False)]),
        (
            "no-depth-loss",
            [("static-low", 30, False), ("motion", 20, False), ("dynamic", 50, False)],
        ),
        # 20 steps of 0.5 s and 50 of 2 s, in steps of 2 s.
        ("no-motion-stage", [("static-low", 30, True), ("dynamic", 55, False)]),
        ("no-order", [("dynamic", 70, False)]),
    ],
)
def test_seconds_of_stages_left_out_become_steps_of_the_dynamic_one(
    lab: Lab, name: str, expected: list[tuple[str, int, bool]]
) -> None:
    for _ in range(2):
        costs = train_variant(variant(name), lab)
        assert [(cost.stage, cost.steps, cost.shared) for cost in costs] == expected


def test_a_motion_stage_that_learns_the_same_is_a_link(lab: Lab) -> None:
    other = Variant(
        name="other", title="other", changes=("stages.dynamic.losses.reconstruction.depth=0",)
    )
    assert [cost.shared for cost in train_variant(other, lab)] == [True, True, False]
    assert (lab.out / "other" / "motion").resolve() == lab.out / "full" / "motion"
    assert not (lab.out / "other" / "dynamic").is_symlink()


def test_plans_say_whose_seconds_a_stage_took(lab: Lab) -> None:
    train_variant(variant("no-order"), lab)
    plan = json.loads((lab.out / "no-order" / "plan-dynamic.json").read_text())
    assert plan == {"steps": 70, "own_step_s": 2.0, "full_step_s": STEP_S}


def test_a_stage_that_was_begun_after_other_stages_is_refused(tmp_path: Path) -> None:
    earlier = recipe_of(variant("no-motion-stage"), BASE)
    earlier = with_steps(earlier, "dynamic", 50)
    folder = begun(tmp_path / "dynamic", finished=True, recipe=earlier)
    with pytest.raises(ConfigError, match="expected a stage of the same recipe"):
        is_finished(folder, BASE)


@pytest.mark.parametrize("finished", [False, True])
def test_a_stage_is_finished_when_its_result_says_so(tmp_path: Path, finished: bool) -> None:
    assert is_finished(begun(tmp_path / "dynamic", finished), BASE) is finished


def test_a_stage_that_was_not_begun_is_not_finished(tmp_path: Path) -> None:
    assert not is_finished(tmp_path / "dynamic", BASE)


def test_a_stage_of_other_steps_is_refused(tmp_path: Path) -> None:
    folder = begun(tmp_path / "dynamic", finished=True)
    with pytest.raises(ConfigError, match=r"expected a stage of the same recipe.*another --out"):
        is_finished(folder, with_steps(BASE, "dynamic", 51))


def test_a_link_leads_to_its_target_and_may_be_made_again(tmp_path: Path) -> None:
    target = begun(tmp_path / "run" / "vae", finished=True)
    for _ in range(2):
        link(target, tmp_path / "out" / "full" / "vae")
    assert (tmp_path / "out" / "full" / "vae" / RECIPE_FILE).read_text() == recipe_to_json(BASE)


def test_a_link_to_something_else_is_refused(tmp_path: Path) -> None:
    first, second = (begun(tmp_path / name / "vae", finished=True) for name in ("a", "b"))
    link(first, tmp_path / "vae")
    with pytest.raises(ConfigError, match=r"expected a link to .*b/vae, got .*a/vae"):
        link(second, tmp_path / "vae")
    with pytest.raises(ConfigError, match="expected a link"):
        link(second, first)


def test_the_autoencoder_must_be_over(tmp_path: Path) -> None:
    stopped = begun(tmp_path / "a" / "vae", finished=False)
    with pytest.raises(ConfigError, match="expected an autoencoder with statistics"):
        require_autoencoder(stopped.parent)
    write_statistics((torch.zeros(2), torch.ones(2)), stopped)
    assert require_autoencoder(stopped.parent).name == "vae"
    with pytest.raises(ConfigError, match="got none"):
        require_autoencoder(tmp_path / "c")
