"""The table of presets: which move, how far by default, and in what unit an amplitude counts.

A ``near depth`` amplitude is a share of the depth of the nearest content, so one number suits a
coffee cup and a valley; a ``turn`` amplitude is a share of 360 degrees. A negative amplitude runs
the move the other way.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    from diff4splat.paths.moves import Move


@dataclass(frozen=True, slots=True, kw_only=True)
class Preset:
    """One named move."""

    summary: str
    move: "Callable[[Any, float, float], Move]"
    """(progress, extent, focus_depth) to poses."""
    unit: Literal["near depth", "turn", "none"] = "near depth"
    default_amplitude: float = 0.15
    approach: int = 0
    """+1 when a positive amplitude brings the camera nearer to the content, -1 when farther."""

    def extent(self, amplitude: float, near_depth: float) -> float:
        """The amplitude in scene units or radians."""
        return amplitude * (2 * math.pi if self.unit == "turn" else near_depth)


def _move(name: str, **fixed: object) -> "Callable[[Any, float, float], Move]":
    """A function of ``moves``, imported when it is called: names are checked without torch."""

    def move(progress: Any, extent: float, focus_depth: float) -> "Move":
        from diff4splat.paths import moves

        return getattr(moves, name)(progress, extent, focus_depth, **fixed)

    return move


PRESETS: dict[str, Preset] = {
    "static": Preset(
        summary="stays where it is",
        move=_move("straight", direction=(0.0, 0.0, 0.0)),
        unit="none",
        default_amplitude=0.0,
    ),
    "orbit": Preset(
        summary="circles the focus point, starting to the right; orbit:1 is a whole turn",
        move=_move("orbit"),
        unit="turn",
        default_amplitude=0.03,
    ),
    "arc": Preset(
        summary="swings right, left and back around the focus point, which stays centred",
        move=_move("arc"),
        default_amplitude=0.2,
    ),
    "spiral": Preset(
        summary="circles twice with a growing radius, looking at the focus point",
        move=_move("spiral"),
    ),
    "forward": Preset(
        summary="moves straight ahead",
        move=_move("straight", direction=(0.0, 0.0, 1.0)),
        default_amplitude=0.25,
        approach=1,
    ),
    "backward": Preset(
        summary="moves straight back",
        move=_move("straight", direction=(0.0, 0.0, -1.0)),
        default_amplitude=0.25,
        approach=-1,
    ),
    "up": Preset(summary="rises", move=_move("straight", direction=(0.0, -1.0, 0.0))),
    "down": Preset(summary="sinks", move=_move("straight", direction=(0.0, 1.0, 0.0))),
    "left": Preset(
        summary="slides to the left", move=_move("straight", direction=(-1.0, 0.0, 0.0))
    ),
    "right": Preset(
        summary="slides to the right", move=_move("straight", direction=(1.0, 0.0, 0.0))
    ),
    "roll": Preset(
        summary="turns clockwise about the viewing axis",
        move=_move("roll"),
        unit="turn",
        default_amplitude=0.1,
    ),
    "dolly-zoom": Preset(
        summary="moves ahead while the lens widens; what lies at the focus depth keeps its size",
        move=_move("dolly_zoom"),
        default_amplitude=0.25,
        approach=1,
    ),
    "figure8": Preset(
        summary="draws a lying eight, looking at the focus point", move=_move("figure8")
    ),
}

ALIASES: dict[str, tuple[str, int]] = {
    "dolly-in": ("forward", 1),
    "push-in": ("forward", 1),
    "dolly-out": ("backward", 1),
    "pull-out": ("backward", 1),
    "pedestal-up": ("up", 1),
    "pedestal-down": ("down", 1),
    "swipe-left": ("left", 1),
    "swipe-right": ("right", 1),
    "truck-left": ("left", 1),
    "truck-right": ("right", 1),
    "orbit-right": ("orbit", 1),
    "orbit-left": ("orbit", -1),
    "roll-cw": ("roll", 1),
    "roll-ccw": ("roll", -1),
    "vertigo": ("dolly-zoom", 1),
    "figure-8": ("figure8", 1),
}
"""Other programs' names: the preset, and the sign that its amplitude gets."""

AMBIGUOUS: dict[str, str] = {
    "pan": "write left or right to slide, arc to swing around the subject",
    "zoom": "write forward or backward to travel, dolly-zoom to change the lens as well",
}
"""First words with different meanings in different programs, and what to write instead."""
