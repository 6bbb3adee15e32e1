"""What draws procedural worlds, as commands see it: compiled before it is needed."""

from collections.abc import Iterable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from diff4splat.evaluation.protocols.protocol import SourceRange
    from diff4splat.progress.phases import Phases
    from diff4splat.training.recipe import SourceSettings

COMPILE_S = 20
"""Seconds that compiling takes on a laptop."""


def prepare_sources(sources: "Iterable[SourceSettings | SourceRange]", phases: "Phases") -> None:
    """Before clips come from ``sources``: compile what draws worlds if one of them is that."""
    if any(source.kind == "worlds" for source in sources):
        from diff4splat.data_prep.synthetic.drawing.warm import prepare_drawing

        prepare_drawing(phases)


def readiness() -> str:
    """Whether a world can be drawn at once."""
    from diff4splat.data_prep.synthetic.drawing import warm

    if warm.is_ready():
        return "ready"
    return f"will compile on first use (about {COMPILE_S} s); now: diff4splat doctor --warm"
