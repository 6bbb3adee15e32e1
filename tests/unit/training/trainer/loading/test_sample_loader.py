"""Samples that cannot be used are replaced and counted; workers change nothing."""

import os

import pytest
import torch
from toy_training import ToySamples

from diff4splat.errors import InputError
from diff4splat.training.trainer.loading.loader import (
    MOST_ATTEMPTS,
    batches,
    load_batch,
    require_batch,
)
from diff4splat.training.trainer.loading.sampler import BatchPlan, StepRange
from diff4splat.training.trainer.loading.samples import (
    EVALUATION_START,
    replacement,
    training_index,
)


def steps(end: int) -> StepRange:
    plan = BatchPlan(global_batch=2, micro_batch=2, ranks=1, rank=0)
    return StepRange(plan=plan, begin=0, end=end, first=0)


def test_a_bad_sample_is_replaced_by_a_fixed_other_one() -> None:
    loaded = load_batch(ToySamples(unusable=frozenset({5})), [4, 5])
    assert loaded.batch.sample_index.tolist() == [4, replacement(5, 1)]
    (failure,) = loaded.failures
    assert (failure.sample, failure.reason) == (5, "InputError: expected some depth")
    assert "clip 5" in failure.message


def test_a_bad_replacement_is_replaced_again() -> None:
    samples = ToySamples(unusable=frozenset({5, replacement(5, 1)}))
    loaded = load_batch(samples, [5])
    assert loaded.batch.sample_index.tolist() == [replacement(5, 2)]
    assert [failure.sample for failure in loaded.failures] == [5, 5]


def test_replacements_stay_on_their_side_of_the_evaluation_samples() -> None:
    for attempt in range(1, 50):
        assert 0 <= replacement(3, attempt) < EVALUATION_START
        assert EVALUATION_START <= replacement(EVALUATION_START + 3, attempt) < 2**41


def test_replacements_say_which_sample_was_asked_for() -> None:
    assert replacement(5, 0) == 5
    assert len({replacement(5, attempt) for attempt in range(MOST_ATTEMPTS)}) == MOST_ATTEMPTS
    assert {training_index(replacement(5, attempt)) for attempt in range(MOST_ATTEMPTS)} == {5}


def test_a_broken_source_ends_the_run_with_reasons() -> None:
    loaded = load_batch(ToySamples(all_unusable=True), [8])
    with pytest.raises(InputError, match=f"sample 8: expected .* {MOST_ATTEMPTS} × InputError"):
        require_batch(loaded)


def test_other_errors_are_bugs_and_not_swallowed() -> None:
    class Broken(ToySamples):
        def __getitem__(self, sample_index: int) -> object:
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        load_batch(Broken(), [0])


def test_worker_processes_give_the_same_batches_in_the_same_order() -> None:
    samples, before = ToySamples(unusable=frozenset({2})), os.environ.get("OMP_NUM_THREADS")
    here = list(batches(samples, steps(3), workers=0))
    there = list(batches(samples, steps(3), workers=1))
    assert os.environ.get("OMP_NUM_THREADS") == before
    assert [loaded.failures for loaded in here] == [loaded.failures for loaded in there]
    for mine, theirs in zip(here, there, strict=True):
        assert torch.equal(mine.batch.sample_index, theirs.batch.sample_index)
        assert torch.equal(mine.batch.x, theirs.batch.x)
        assert theirs.waited_s >= 0
