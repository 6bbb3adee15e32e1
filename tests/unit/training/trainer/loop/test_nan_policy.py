"""When steps are skipped, when runs are rolled back, and when they give up."""

import math

import pytest

from diff4splat.errors import FileFormatError
from diff4splat.training.recipe.trainer import TrainerSettings
from diff4splat.training.trainer.loop.nan_policy import (
    LEAST_HISTORY,
    DivergenceError,
    after_rollback,
    is_spike,
    outlier_reason,
    record_loss,
    record_skip,
    require_few_skips,
    skip_reason,
)
from diff4splat.training.trainer.loop.progress import MEDIAN_WINDOW, Progress

SETTINGS = TrainerSettings(most_skips_in_a_row=3, most_skips_share=0.1)


@pytest.mark.parametrize(
    ("loss", "norm", "said"),
    [
        (1.0, 2.0, None),
        (math.nan, math.nan, "loss"),
        (math.inf, 1.0, "loss"),
        (1.0, math.nan, "grad"),
    ],
)
def test_why_a_step_is_skipped(loss: float, norm: float, said: str | None) -> None:
    reason = skip_reason(loss, norm)
    assert reason is None if said is None else said in reason


def test_a_run_gives_up_after_skips_in_a_row(tmp_path) -> None:
    progress = Progress(step=1000)
    for _ in range(2):
        record_skip(progress, "loss is not finite")
        require_few_skips(progress, SETTINGS, tmp_path / "skipped.json")
    record_skip(progress, "loss is not finite")
    with pytest.raises(DivergenceError, match=r"got 3 in a row .*3 × loss is not.*skipped\.json"):
        require_few_skips(progress, SETTINGS, tmp_path / "skipped.json")


def test_a_run_gives_up_after_a_share_of_skips_but_not_at_once(tmp_path) -> None:
    progress = Progress(step=4, skips={"a": 3})
    require_few_skips(progress, SETTINGS, tmp_path)
    progress.skips["b"] = 1
    with pytest.raises(DivergenceError, match=r"at most 10\.0% of all.* 4 of 5"):
        require_few_skips(progress, SETTINGS, tmp_path)
    progress.step = 100
    require_few_skips(progress, SETTINGS, tmp_path)


def test_a_spike_is_far_above_the_median_of_what_was_before() -> None:
    progress = Progress()
    for _ in range(LEAST_HISTORY - 1):
        record_loss(progress, 1.0, factor=5.0)
    assert not is_spike(progress, 100.0, factor=5.0)
    record_loss(progress, 1.0, factor=5.0)
    assert is_spike(progress, 5.1, factor=5.0)
    assert not is_spike(progress, 4.9, factor=5.0)
    assert not is_spike(progress, 100.0, factor=0.0)
    assert record_loss(progress, 9.0, factor=5.0)
    assert record_loss(progress, 9.0, factor=5.0)
    assert (progress.spikes, progress.spikes_in_a_row) == (2, 2)
    record_loss(progress, 1.0, factor=5.0)
    assert (progress.spikes, progress.spikes_in_a_row) == (2, 0)


def test_a_new_level_of_loss_stops_being_a_spike() -> None:
    progress = Progress(recent_losses=[1.0] * MEDIAN_WINDOW)
    spikes = [record_loss(progress, 10.0, factor=5.0) for _ in range(MEDIAN_WINDOW)]
    assert spikes[0]
    assert not spikes[-1]
    assert len(progress.recent_losses) == MEDIAN_WINDOW


@pytest.mark.parametrize(("center", "usual", "spike"), [(-1.0, 2.9, 3.1), (0.0, 3.9, 4.1)])
def test_losses_around_and_below_zero_have_spikes_by_their_size(
    center: float, usual: float, spike: float
) -> None:
    # Sizes are 1 in both cases; a median near 0 must not make every loss a spike.
    losses = [center] * 50 if center else [-1.0, 1.0] * 25
    assert not is_spike(Progress(recent_losses=losses), usual, factor=5.0)
    assert is_spike(Progress(recent_losses=losses), spike, factor=5.0)


def test_losses_of_zero_have_no_size_to_compare_with() -> None:
    assert not is_spike(Progress(recent_losses=[0.0] * 50), 3.0, factor=5.0)


def test_a_rollback_leaves_out_the_data_of_the_detour() -> None:
    now = Progress(step=12, first_sample=40, skips={"a": 1}, spikes=3, spikes_in_a_row=3)
    then = after_rollback(now, Progress(step=10, first_sample=40), global_batch=4)
    # The next sample of the detour would have been 40 + 13·4; step 10 takes first + 10·4.
    assert then.first_sample + 10 * 4 == 40 + 13 * 4
    assert (then.step, then.skips, then.spikes, then.rollbacks) == (10, {"a": 1}, 3, 1)
    assert then.rollbacks_to == {"10": 1}


def test_rollbacks_that_do_not_help_end_the_run() -> None:
    now = Progress(step=12, rollbacks_to={"10": 3})
    with pytest.raises(DivergenceError, match="steady loss after step 10"):
        after_rollback(now, Progress(step=10), global_batch=4)


def test_progress_survives_json() -> None:
    progress = Progress(step=3, recent_losses=[0.1, 1 / 3], measures={"psnr": None, "a": 1.5})
    assert Progress.from_json(progress.to_json()) == progress


@pytest.mark.parametrize(
    "change", [{"colour": 1}, {"step": "3"}, {"step": None}, {"recent_losses": {}}]
)
def test_progress_of_another_kind_is_refused(change: dict) -> None:
    with pytest.raises(FileFormatError, match=f"others or other types at {next(iter(change))}"):
        Progress.from_json(Progress().to_json() | change)


def test_progress_without_a_key_is_refused() -> None:
    found = Progress().to_json()
    del found["spikes"]
    with pytest.raises(FileFormatError, match="spikes"):
        Progress.from_json(found)


def test_an_outlier_is_not_learnt_from_and_counts_as_a_spike() -> None:
    progress, settings = Progress(), TrainerSettings(outlier_factor=50.0)
    for _ in range(LEAST_HISTORY):
        record_loss(progress, 1.0, 5.0)
    assert outlier_reason(progress, 49.0, settings) is None
    assert "outlier" in outlier_reason(progress, 51.0, settings)
    assert (progress.spikes, progress.spikes_in_a_row) == (1, 1)
    assert outlier_reason(progress, 1e9, TrainerSettings(outlier_factor=0.0)) is None
