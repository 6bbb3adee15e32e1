"""Every sample of a step is taken once, whoever takes it."""

from math import prod

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from toy_training import Toy

from diff4splat.errors import ConfigError
from diff4splat.training.trainer.loading.sampler import BatchPlan, StepRange, plan_batches

SIZES = st.tuples(st.integers(1, 4), st.integers(1, 3), st.integers(1, 4))
"""Micro batch, accumulation, ranks."""


def plan(size: tuple[int, int, int], rank: int) -> BatchPlan:
    micro, _, ranks = size
    return BatchPlan(global_batch=prod(size), micro_batch=micro, ranks=ranks, rank=rank)


@settings(max_examples=25, deadline=None)
@given(size=SIZES, steps=st.integers(1, 5), first=st.integers(0, 1000))
def test_every_index_is_taken_exactly_once(size, steps: int, first: int) -> None:
    taken = []
    for rank in range(size[2]):
        own = StepRange(plan=plan(size, rank), begin=0, end=steps, first=first)
        lists = list(own)
        assert len(lists) == len(own) == steps * size[1]
        assert {len(indices) for indices in lists} == {size[0]}
        taken += [index for indices in lists for index in indices]
    assert sorted(taken) == list(range(first, first + steps * prod(size)))


@settings(max_examples=25, deadline=None)
@given(size=SIZES, step=st.integers(0, 10**6), first=st.integers(0, 10**6))
def test_a_step_holds_the_same_samples_on_any_process_count(size, step: int, first: int) -> None:
    micro, _, ranks = size
    shared = [i for r in range(ranks) for b in plan(size, r).micro_batches(step, first) for i in b]
    alone = BatchPlan(global_batch=prod(size), micro_batch=micro, ranks=1, rank=0)
    assert sorted(shared) == [i for b in alone.micro_batches(step, first) for i in b]


@settings(max_examples=25, deadline=None)
@given(size=SIZES, cut=st.integers(0, 4))
def test_resuming_goes_on_where_it_stopped(size, cut: int) -> None:
    whole = list(StepRange(plan=plan(size, 0), begin=0, end=4, first=7))
    before = list(StepRange(plan=plan(size, 0), begin=0, end=cut, first=7))
    assert before + list(StepRange(plan=plan(size, 0), begin=cut, end=4, first=7)) == whole


def test_accumulations_of_one_rank_interleave_with_those_of_others() -> None:
    two = BatchPlan(global_batch=8, micro_batch=2, ranks=2, rank=1)
    assert list(two.micro_batches(1, 100)) == [[110, 111], [114, 115]]


@pytest.mark.parametrize(("batch", "micro", "ranks"), [(4, 2, 3), (3, 2, 1), (0, 1, 1), (4, 0, 1)])
def test_what_does_not_divide_is_refused(batch: int, micro: int, ranks: int) -> None:
    with pytest.raises(ConfigError, match=f"multiple of {ranks} processes times micro batch"):
        BatchPlan(global_batch=batch, micro_batch=micro, ranks=ranks, rank=0)


def test_a_recipe_has_a_plan() -> None:
    assert plan_batches(Toy().recipe(), ranks=2, rank=0).accumulation == 1
