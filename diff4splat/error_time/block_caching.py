"""Values of the setting ``block-caching``: how many steps, and when blocks are not run again."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class BlockCaching:
    """Steps, and the relative change of their input up to which blocks are not run again."""

    steps: int
    largest_change: float = 0.0
    """Root mean square of the change over that of the input; 0 always runs them."""

    def __str__(self) -> str:
        if not self.largest_change:
            return f"{self.steps} steps"
        return f"{self.steps} steps, reuse up to {self.largest_change:g}"

    @property
    def series(self) -> str:
        """One curve without reuse, one with it."""
        return f"{self.steps} steps, reuse" if self.largest_change else "every block at every step"

    @property
    def label(self) -> str:
        """What changes along the curve."""
        return f"{self.largest_change:g}" if self.largest_change else str(self.steps)


NO_CACHING = BlockCaching(steps=8)
CACHINGS = (
    *(BlockCaching(steps=steps) for steps in (6, 8, 12, 24)),
    *(BlockCaching(steps=24, largest_change=change) for change in (0.02, 0.05, 0.1, 0.2, 0.4)),
)
