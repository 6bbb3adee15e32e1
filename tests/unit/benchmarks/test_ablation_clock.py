"""Processor seconds of steps, and steps for a budget of them."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from ablations.clock import StepClock, step_seconds, steps_for, typical_s

from diff4splat.configs.recipes import recipe_by_name
from diff4splat.training.recipe.stage import StageRecipe
from diff4splat.training.trainer.logs.run_files import LOG_FILE


def stage() -> StageRecipe:
    return recipe_by_name("test").stage("static-low")


def clock(folder: Path, times_s: list[float], notes: list[str] | None = None) -> StepClock:
    ticks: Iterator[float] = iter(times_s)
    return StepClock(
        folder=folder,
        stage=stage(),
        note=lambda text: None if notes is None else notes.append(text),
        now_s=lambda: next(ticks),
    )


def steps(watch: StepClock, remaining: int, count: int) -> None:
    with watch.phase("static-low", remaining) as advance:
        for _ in range(count):
            advance()


def test_every_step_has_the_seconds_since_the_one_before(tmp_path: Path) -> None:
    steps(clock(tmp_path, [5.0, 5.5, 7.5]), remaining=100, count=2)
    assert step_seconds(tmp_path) == [0.5, 2.0]


def test_a_step_that_is_done_again_counts_once(tmp_path: Path) -> None:
    steps(clock(tmp_path, [0.0, 1.0, 2.0, 3.0]), remaining=100, count=3)
    steps(clock(tmp_path, [50.0, 54.0, 59.0]), remaining=99, count=2)
    assert step_seconds(tmp_path) == [1.0, 4.0, 5.0]


def test_half_a_row_of_a_killed_run_is_passed_over(tmp_path: Path) -> None:
    steps(clock(tmp_path, [0.0, 1.0]), remaining=100, count=1)
    with (tmp_path / LOG_FILE).open("a") as file:
        file.write('{"event": "cp')
    steps(clock(tmp_path, [0.0, 2.0]), remaining=99, count=1)
    assert step_seconds(tmp_path) == [1.0, 2.0]


def test_other_rows_and_phases_do_not_count(tmp_path: Path) -> None:
    watch = clock(tmp_path, [])
    with watch.phase("measure latents", 3) as advance:
        advance()
    assert not (tmp_path / LOG_FILE).exists()
    (tmp_path / LOG_FILE).write_text('{"event": "step", "step": 0, "seconds": 9.0}\n')
    assert step_seconds(tmp_path) == []


def test_people_hear_of_every_tenth_of_a_stage(tmp_path: Path) -> None:
    notes: list[str] = []
    steps(clock(tmp_path, [float(i) for i in range(101)], notes), remaining=100, count=100)
    assert len(notes) == 10
    assert notes[0].endswith("step 10 of 100")


def test_the_first_steps_do_not_count() -> None:
    assert typical_s([90.0, 80.0, 1.0, 9.0, 2.0], warm_up=2) == 2.0


@pytest.mark.parametrize(
    ("own_s", "budget", "expected"),
    [
        (1.0, [(300, 1.0)], 300),
        (1.5, [(300, 1.0)], 200),
        (2.0, [(300, 1.0), (100, 5.0)], 400),
        (1000.0, [(300, 1.0)], 1),
    ],
)
def test_steps_take_as_long_as_those_they_replace(
    own_s: float, budget: list[tuple[int, float]], expected: int
) -> None:
    assert steps_for(own_s, budget) == expected
