"""Folders of variants: links, and stages that must not be taken for others."""

from pathlib import Path

import pytest
import torch
from ablations.course import is_finished, link, require_autoencoder
from ablations.variants import reduced, with_steps

from diff4splat.configs.recipes import recipe_by_name
from diff4splat.errors import ConfigError
from diff4splat.training.latent_statistics import write_statistics
from diff4splat.training.recipe_json import recipe_to_json
from diff4splat.training.stage_run import RECIPE_FILE
from diff4splat.training.trainer.gates import StoredResult, write_result

BASE = reduced(recipe_by_name("small"), 30, 50)


def begun(folder: Path, finished: bool) -> Path:
    """A stage folder as the trainer leaves it, as far as it is looked at here."""
    folder.mkdir(parents=True)
    (folder / RECIPE_FILE).write_text(recipe_to_json(BASE))
    result = StoredResult(
        stage=folder.name, finished=finished, step=1, checkpoint="none", measures={}
    )
    write_result(folder, result)
    return folder


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
