"""How many clips enter and leave each stage, in all and per data set."""

from collections import Counter
from dataclasses import dataclass

from diff4splat.data_prep.curation.decisions import ORDER, Decision


@dataclass(frozen=True, slots=True, kw_only=True)
class StageCount:
    """One stage."""

    stage: str
    entered: int
    rejected: int

    @property
    def left(self) -> int:
        """What goes on to the next stage."""
        return self.entered - self.rejected


def stage_counts(decisions: list[Decision]) -> list[StageCount]:
    """In the order of the stages; a clip is rejected by the first stage that has a reason."""
    rejected = Counter(each.reasons[0].stage for each in decisions if each.reasons)
    counts, entered = [], len(decisions)
    for stage in ORDER:
        counts.append(StageCount(stage=stage, entered=entered, rejected=rejected[stage]))
        entered -= rejected[stage]
    return counts


def by_dataset(decisions: list[Decision]) -> dict[str, list[Decision]]:
    """Decisions per data set, sorted by its name."""
    groups: dict[str, list[Decision]] = {}
    for decision in decisions:
        groups.setdefault(decision.record.dataset or "unnamed", []).append(decision)
    return dict(sorted(groups.items()))


def by_reason(decisions: list[Decision]) -> dict[tuple[str, str], list[Decision]]:
    """Rejected clips by stage and text of their first reason, the most frequent first."""
    groups: dict[tuple[str, str], list[Decision]] = {}
    for decision in decisions:
        if decision.reasons:
            first = decision.reasons[0]
            groups.setdefault((first.stage, first.text), []).append(decision)
    return dict(sorted(groups.items(), key=lambda item: (-len(item[1]), item[0])))
