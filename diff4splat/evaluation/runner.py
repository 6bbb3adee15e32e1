"""Measures item after item: takes up what is there, keeps going when one fails, and counts it."""

from dataclasses import dataclass

from diff4splat.errors import Diff4SplatError, InputError
from diff4splat.evaluation.measuring import Setup, measure_item
from diff4splat.evaluation.records import Failure, ItemResult
from diff4splat.evaluation.result_store import ItemStore
from diff4splat.evaluation.sources import ClipSource, require_enough
from diff4splat.progress.phases import Phases


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What a run ended with."""

    setup: Setup
    items: tuple[ItemResult, ...]
    failures: tuple[Failure, ...]
    asked: int
    """Items that the run was to measure."""
    taken_up: int
    """Of these, how many had been measured before."""

    @property
    def is_subset(self) -> bool:
        """Fewer than the protocol has: figures cannot be compared with those of whole runs."""
        return self.asked < self.setup.protocol.items(self.setup.task)


def run_items(
    source: ClipSource, setup: Setup, store: ItemStore, limit: int | None, phases: Phases
) -> Outcome:
    """Measure the first ``limit`` items, or all.

    Raises:
        InputError: the source is empty or too short, or ``limit`` is not within the protocol.
        OutputError: results cannot be stored.
    """
    require_enough(source, setup.protocol)
    wanted = range(_asked(setup, limit))
    missing = [item for item in wanted if item not in store.items]
    failures = []
    with phases.phase(f"measure {setup.task}", len(missing)) as advance:
        for item in missing:
            result = attempt(item, source, setup)
            if isinstance(result, Failure):
                failures.append(result)
            else:
                store.add(result)
            advance()
    return Outcome(
        setup=setup,
        items=tuple(store.items[item] for item in wanted if item in store.items),
        failures=tuple(failures),
        asked=len(wanted),
        taken_up=len(wanted) - len(missing),
    )


def attempt(item: int, source: ClipSource, setup: Setup) -> ItemResult | Failure:
    """One item; whatever goes wrong with it is told, not raised."""
    name = f"index {setup.protocol.source.first + item}"
    try:
        clip = source.clip(setup.protocol.source.first + item)
        name = clip.note.identifier
        return measure_item(item, clip, setup)
    except Exception as error:
        # One bad clip, or one that a network cannot take, must not cost the others.
        kind = "" if isinstance(error, Diff4SplatError) else f"{type(error).__name__}: "
        return Failure(item=item, clip=name, why=kind + " ".join(str(error).split()))


def require_some(outcome: Outcome) -> Outcome:
    """Return ``outcome`` unless nothing at all could be measured.

    Raises:
        InputError: with the first reason.
    """
    if outcome.items or not outcome.failures:
        return outcome
    first = outcome.failures[0]
    raise InputError(
        f"evaluation: expected results, got none: all {len(outcome.failures)} items failed, "
        f"the first ({first.clip}) with: {first.why}"
    )


def _asked(setup: Setup, limit: int | None) -> int:
    whole = setup.protocol.items(setup.task)
    if limit is None:
        return whole
    if not 1 <= limit <= whole:
        raise InputError(f"--items: expected 1 to {whole} for this protocol, got {limit}")
    return limit
