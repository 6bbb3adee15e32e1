"""``--time``: a moment of a scene."""

import math
from typing import TYPE_CHECKING

from diff4splat.errors import ConfigError

if TYPE_CHECKING:
    from diff4splat.scene.scene import Scene

ROUNDING_S = 1e-4
"""Key times are stored in float32, so the last one may lie a rounding error off."""


def require_scene_time(scene: "Scene", time_s: float | None) -> None:
    """Refuse a time that the scene does not have; a static scene is the same at any time.

    Raises:
        ConfigError: the time is not finite, or outside the motion.
    """
    if time_s is None:
        return
    start_s, stop_s = scene.motion.time_range_s
    moves = len(scene.motion.moving_index) > 0
    inside = start_s - ROUNDING_S <= time_s <= stop_s + ROUNDING_S
    if not math.isfinite(time_s) or (moves and not inside):
        raise ConfigError(
            f"--time: expected {start_s:g} to {stop_s:g} seconds, as the scene has, got {time_s:g}"
        )
