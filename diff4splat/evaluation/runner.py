"""Measure all items: reuse stored results, and continue after a failed item."""

from dataclasses import dataclass

from diff4splat.errors import Diff4SplatError, InputError
from diff4splat.evaluation.measure_item import Setup, measure_item
from diff4splat.evaluation.protocols.sources import ClipSource, require_enough
from diff4splat.evaluation.records import Failure, ItemResult
from diff4splat.evaluation.report.result_store import ItemStore
from diff4splat.progress.phases import Phases


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """Results of a run."""

    setup: Setup
    items: tuple[ItemResult, ...]
    failures: tuple[Failure, ...]
    requested: int
    """Number of items that the run was asked to measure."""
    resumed: int
    """Number of items with stored results of an earlier run."""

    @property
    def is_subset(self) -> bool:
        """Whether items of the protocol are missing; then means are not comparable."""
        return self.requested < self.setup.protocol.items(self.setup.task)


def run_items(
    source: ClipSource, setup: Setup, store: ItemStore, limit: int | None, phases: Phases
) -> Outcome:
    """Measure the first ``limit`` items, or all.

    Raises:
        InputError: the source is empty or too short, or ``limit`` exceeds the protocol.
        OutputError: results cannot be stored.
    """
    require_enough(source, setup.protocol)
    wanted = range(_requested_count(setup, limit))
    missing = [item for item in wanted if item not in store.items]
    failures = []
    with phases.phase(f"measure {setup.task}", len(missing)) as advance:
        for item in missing:
            result = try_item(item, source, setup)
            if isinstance(result, Failure):
                failures.append(result)
            else:
                store.add(result)
            advance()
    return Outcome(
        setup=setup,
        items=tuple(store.items[item] for item in wanted if item in store.items),
        failures=tuple(failures),
        requested=len(wanted),
        resumed=len(wanted) - len(missing),
    )


def try_item(item: int, source: ClipSource, setup: Setup) -> ItemResult | Failure:
    """Measure one item; an error becomes a ``Failure``."""
    name = f"index {setup.protocol.source.first + item}"
    try:
        clip = source.clip(setup.protocol.source.first + item)
        name = clip.note.identifier
        return measure_item(item, clip, setup)
    except Exception as error:
        # One bad clip must not cost the results of the others.
        kind = "" if isinstance(error, Diff4SplatError) else f"{type(error).__name__}: "
        return Failure(item=item, clip=name, why=kind + " ".join(str(error).split()))


def require_results(outcome: Outcome) -> Outcome:
    """Return ``outcome`` unless every item failed.

    Raises:
        InputError: with the first failure.
    """
    if outcome.items or not outcome.failures:
        return outcome
    first = outcome.failures[0]
    raise InputError(
        f"evaluation: expected results, got none: all {len(outcome.failures)} items failed, "
        f"the first ({first.clip}) with: {first.why}"
    )


def _requested_count(setup: Setup, limit: int | None) -> int:
    total = setup.protocol.items(setup.task)
    if limit is None:
        return total
    if not 1 <= limit <= total:
        raise InputError(f"--items: expected 1 to {total} for this protocol, got {limit}")
    return limit
