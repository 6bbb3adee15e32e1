"""Thresholds on scores: which clips are selected, and why the others are not.

Applied last and to all records at once, in the order of the stages; nothing is measured here. The
first reason is the one that counts a clip as rejected in its stage; all are kept.
"""

from collections import defaultdict
from dataclasses import dataclass

from diff4splat.data_prep.curation.clip_record import ClipRecord
from diff4splat.data_prep.curation.duplicates.cells import alike_features
from diff4splat.data_prep.curation.duplicates.hashes import duplicates_of
from diff4splat.data_prep.curation.scoring import STAGES
from diff4splat.data_prep.curation.thresholds import Gate, Thresholds

ORDER = ("reading", *STAGES)


@dataclass(frozen=True, slots=True, kw_only=True)
class Reason:
    """Why a clip is not selected."""

    stage: str
    text: str
    """Without numbers, so that equal reasons can be counted."""
    detail: str = ""
    """With the number and the limit."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Decision:
    """One clip and its reasons; selected without any."""

    record: ClipRecord
    reasons: tuple[Reason, ...] = ()

    @property
    def is_selected(self) -> bool:
        """No reason speaks against it."""
        return not self.reasons


def decide(records: list[ClipRecord], thresholds: Thresholds) -> list[Decision]:
    """A decision per record, sorted by folder and identifier."""
    records = sorted(records, key=lambda record: record.key)
    reasons = {record.key: _gate_reasons(record, thresholds.gates) for record in records}
    passed = [record for record in records if not reasons[record.key]]
    for record, reason in _duplicates(passed, thresholds):
        reasons[record.key].append(reason)
    passed = [record for record in passed if not reasons[record.key]]
    for record, reason in _over_quota(passed, thresholds):
        reasons[record.key].append(reason)
    return [Decision(record=record, reasons=tuple(reasons[record.key])) for record in records]


def merit(record: ClipRecord) -> tuple[float, ...]:
    """The larger the better: quality, then agreement of depth and cameras, then tracks."""
    scores = record.scores
    return (
        scores.get("quality", 0.0),
        -scores.get("reprojection_error", 1.0),
        scores.get("tracks_reliable", 0.0),
        scores.get("sharpness", 0.0),
    )


def _gate_reasons(record: ClipRecord, gates: tuple[Gate, ...]) -> list[Reason]:
    if record.error:
        detail = f"{record.error}: {record.message}"
        return [Reason(stage=record.stage, text=record.error, detail=detail)]
    failed = [reason for gate in gates if (reason := _failed(record, gate)) is not None]
    return sorted(failed, key=lambda reason: ORDER.index(reason.stage))


def _failed(record: ClipRecord, gate: Gate) -> Reason | None:
    if not _applies(record, gate):
        return None
    value = record.scores.get(gate.score)
    if value is None:
        detail = f"{gate.score} was not measured"
        return Reason(stage=gate.stage, text=gate.reason, detail=detail) if gate.required else None
    low = gate.least is not None and value < gate.least
    high = gate.most is not None and value > gate.most
    if not (low or high):
        return None
    limit = f"at least {gate.least:g}" if low else f"at most {gate.most:g}"
    detail = f"{gate.score} {value:.4g}, expected {limit}"
    return Reason(stage=gate.stage, text=gate.reason, detail=detail)


def _applies(record: ClipRecord, gate: Gate) -> bool:
    dynamic = record.labels.get("motion") in ("slow", "fast")
    return {
        "all": True,
        "real": not record.is_rendered,
        "rendered": record.is_rendered,
        "dynamic": dynamic,
        "static": not dynamic,
    }[gate.applies_to]


def _duplicates(records: list[ClipRecord], thresholds: Thresholds):
    ranked = sorted(records, key=lambda record: (*(-m for m in merit(record)), record.key))
    rejected: set[tuple[str, str]] = set()
    for record, original in duplicates_of(ranked, thresholds.hash_bits):
        detail = f"looks like {original.identifier}"
        yield record, Reason(stage="duplicates", text="duplicate of a better clip", detail=detail)
        rejected.add(record.key)
    remaining = [record for record in ranked if record.key not in rejected]
    for record, original in alike_features(remaining, thresholds.cosine):
        detail = f"features like those of {original.identifier}"
        yield record, Reason(stage="duplicates", text="looks like a better clip", detail=detail)
    if thresholds.per_group:
        yield from _over(
            ranked,
            lambda record: record.labels.get("group", ""),
            lambda _: thresholds.per_group,
            Reason(stage="duplicates", text="enough clips of this scene"),
        )


def _over_quota(records: list[ClipRecord], thresholds: Thresholds):
    ranked = sorted(records, key=lambda record: (*(-m for m in merit(record)), record.key))
    rejected: set[tuple[str, str]] = set()
    for kind, quota in thresholds.quotas.items():
        remaining = [record for record in ranked if record.key not in rejected]
        reason = Reason(stage="balance", text=f"quota of its {_KINDS[kind]}")
        for record, why in _over(remaining, lambda r, k=kind: _class_of(r, k), quota.get, reason):
            rejected.add(record.key)
            yield record, why


_KINDS = {"dataset": "data set", "motion": "class of motion", "path": "class of camera path"}


def _class_of(record: ClipRecord, kind: str) -> str:
    return record.dataset if kind == "dataset" else record.labels.get(kind, "unknown")


def _over(ranked: list[ClipRecord], group_of, limit_of, reason: Reason):
    """Records beyond the limit of their group, best first."""
    counts: dict[str, int] = defaultdict(int)
    for record in ranked:
        group = group_of(record)
        limit = limit_of(group)
        counts[group] += 1
        if limit is not None and counts[group] > limit:
            yield (
                record,
                Reason(
                    stage=reason.stage,
                    text=reason.text,
                    detail=f"{group or 'unnamed'}: {limit} clips",
                ),
            )
