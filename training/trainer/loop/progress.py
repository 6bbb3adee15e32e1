"""The state of a run: everything beside tensors that makes it go on as if it had never stopped.

Kept as ``state.json`` inside every checkpoint. Floats survive JSON exactly.
"""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from typing import Any

from diff4splat.errors import FileFormatError

MEDIAN_WINDOW = 101
"""Losses that the running median looks back on."""


@dataclass(slots=True, kw_only=True)
class Progress:
    """Changes with every step."""

    step: int = 0
    """Steps done; also the position in schedule and data."""
    first_sample: int = 0
    """Sample index of position 0; grows when a window of data is skipped."""
    average_updates: dict[str, int] = field(default_factory=dict)
    """Updates of the weight averages, per part."""
    skips: dict[str, int] = field(default_factory=dict)
    """Steps without an update, by reason."""
    skips_in_a_row: int = 0
    replaced: dict[str, int] = field(default_factory=dict)
    """Samples that were not usable, by reason."""
    recent_losses: list[float] = field(default_factory=list)
    spikes: int = 0
    spikes_in_a_row: int = 0
    rollbacks: int = 0
    rollbacks_to: dict[str, int] = field(default_factory=dict)
    """Roll-backs by the step they went back to."""
    measures: dict[str, float | None] = field(default_factory=dict)
    """Of the last evaluation; None where it was not finite."""

    @property
    def skipped(self) -> int:
        """Steps without an update."""
        return sum(self.skips.values())

    def remember(self, loss: float) -> None:
        """Add to the losses the median is taken of."""
        self.recent_losses = [*self.recent_losses, loss][-MEDIAN_WINDOW:]

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        return asdict(self)

    @classmethod
    def from_json(cls, record: Mapping[str, Any]) -> "Progress":
        """The same progress.

        Raises:
            FileFormatError: keys are missing or unknown, or a value has the wrong type.
        """
        example = asdict(cls())
        wrong = [key for key in record if key not in example]
        wrong += [key for key, value in example.items() if type(record.get(key)) is not type(value)]
        if wrong:
            raise FileFormatError(
                f"progress: expected the keys {', '.join(item.name for item in fields(cls))}, got "
                f"others or other types at {', '.join(wrong)}"
            )
        return cls(**json.loads(json.dumps(dict(record))))
