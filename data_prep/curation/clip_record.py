"""What curation knows of a clip: scores by name, and the error that stopped scoring.

Scores are numbers (NaN is left out: what could not be measured is absent); labels are words, such
as a class of motion. A record is one line of JSON.
"""

import math
from dataclasses import asdict, dataclass, field, replace
from typing import Any

from diff4splat.data.clip import Clip
from diff4splat.data.json_fields import take, take_number
from diff4splat.errors import FileFormatError

SCORING_VERSION = 2
"""Changes when a stage gives other numbers: older scores are then measured again."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ClipRecord:
    """One row."""

    identifier: str
    folder: str = ""
    """Name of the folder of shards."""
    dataset: str = ""
    scene: str = ""
    license: str = ""
    metric: str = "none"
    is_static: bool = False
    has_caption: bool = False
    checksum: str = ""
    """Of the stored clip, the version of scoring and the hooks: scores of others do not count."""
    scores: dict[str, float] = field(default_factory=dict)
    labels: dict[str, str] = field(default_factory=dict)
    error: str = ""
    """Name of the error, such as ``FileFormatError``; then ``message`` says more."""
    message: str = ""
    stage: str = ""
    """Where the error was raised."""

    @property
    def is_rendered(self) -> bool:
        """Lengths are exact: made by a renderer, so that faults of photographs do not apply."""
        return self.metric == "exact"

    @property
    def key(self) -> tuple[str, str]:
        """Unique over all folders."""
        return self.folder, self.identifier

    def with_scores(self, **scores: float | int | None) -> "ClipRecord":
        """The record with more scores; what is None, NaN or infinite is left out."""
        measured = {
            name: float(value)
            for name, value in scores.items()
            if value is not None and math.isfinite(value)
        }
        return replace(self, scores=self.scores | measured)

    def with_labels(self, **labels: str) -> "ClipRecord":
        """The record with more labels."""
        return replace(self, labels=self.labels | labels)

    def failed(self, stage: str, error: Exception) -> "ClipRecord":
        """The record of a clip whose scoring ended in ``stage``."""
        text = " ".join(str(error).split())
        return replace(self, stage=stage, error=type(error).__name__, message=text[:500])


def record_of(clip: Clip, folder: str, checksum: str) -> ClipRecord:
    """A record without scores."""
    note = clip.note
    return ClipRecord(
        identifier=note.identifier,
        folder=folder,
        dataset=note.dataset,
        scene=note.scene,
        license=note.license,
        metric=note.metric,
        is_static=note.is_static,
        has_caption=bool(note.caption.strip()),
        checksum=checksum,
    )


def record_to_json(record: ClipRecord) -> dict[str, Any]:
    """JSON values."""
    return asdict(record)


def record_from_json(source: dict[str, Any]) -> ClipRecord:
    """The record out of JSON values.

    Raises:
        FileFormatError: a value is missing or of another type.
    """
    texts = ("identifier", "folder", "dataset", "scene", "license", "metric")
    texts += ("checksum", "error", "message", "stage")
    scores, labels = take(source, "scores", dict), take(source, "labels", dict)
    if not all(isinstance(label, str) for label in labels.values()):
        raise FileFormatError("'labels': expected texts, got something else in it")
    numbers = {name: take_number(scores, name) for name in scores}
    return ClipRecord(
        **{name: take(source, name, str) for name in texts},
        is_static=take(source, "is_static", bool),
        has_caption=take(source, "has_caption", bool),
        scores={name: value for name, value in numbers.items() if value is not None},
        labels=labels,
    )
