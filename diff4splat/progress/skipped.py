"""Work that a run skipped because the scene does not need it: savings and error.

Stored in ``card.json`` beside the scene, in order.
"""

import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field

from diff4splat.errors import ConfigError


@dataclass(frozen=True, slots=True, kw_only=True)
class SkippedWork:
    """One computation, network or file that was skipped."""

    what: str
    why: str
    saved: str
    """Text with a unit: ``1,234 parameters``, ``12 network calls``."""
    error: float | None = 0.0
    """Resulting error; 0 if the result is identical, None if it was not measured."""
    error_unit: str = ""
    """Unit of an error above 0, such as ``px``."""

    def __post_init__(self) -> None:
        if not (self.what and self.why and self.saved):
            raise ConfigError(
                "SkippedWork: expected what, why and saved in words, got an empty one"
            )
        if self.error is not None and not (math.isfinite(self.error) and self.error >= 0):
            raise ConfigError(f"SkippedWork.error: expected 0 or above, got {self.error}")
        if self.error and not self.error_unit:
            raise ConfigError(
                f"SkippedWork.error_unit: expected a unit of {self.error:g}, got none"
            )

    def __str__(self) -> str:
        value = "not measured" if self.error is None else f"{self.error:.3g}"
        error = f"{value} {self.error_unit}".strip()
        return f"{self.what}: {self.why}; saved {self.saved}; error {error}"


@dataclass(slots=True)
class SkippedWorkList:
    """Collects skipped work while a command runs."""

    _records: list[SkippedWork] = field(default_factory=list)

    def add(self, record: SkippedWork) -> None:
        """Append ``record`` unless it is in the list, so that loops may report repeatedly."""
        if record not in self._records:
            self._records.append(record)

    def __iter__(self) -> Iterator[SkippedWork]:
        return iter(self._records)

    def __len__(self) -> int:
        return len(self._records)

    def to_json(self) -> list[dict[str, str | float | None]]:
        """Plain values for ``card.json``."""
        return [asdict(record) for record in self._records]
