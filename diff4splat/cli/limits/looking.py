"""What a frame of the scene itself loses at cheaper settings of ``diff4splat render``."""

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

from diff4splat.cli.limits.rendering import (
    CUTOFFS,
    DEFAULT_CUTOFF,
    SIDE_SHARES,
    USUAL_DETAIL,
    at_share,
    error_unit,
)
from diff4splat.outputs.budgets.table import SettingRow

if TYPE_CHECKING:
    from torch import Tensor

    from diff4splat.cli.scenes.render import Render

LOOKED_CUTOFFS = CUTOFFS[1:]
SPREAD = 1.25
"""How much more other frames lose than the one in the middle."""


def expected_error(
    row: SettingRow,
    full: Mapping[float, float],
    looked: Mapping[tuple[float, float], float],
) -> float:
    """Of smaller frames and of a cut-off, which add up: as looked at, else from the table.

    ``full`` has errors of frames of full size by cut-off, ``looked`` some by (share, cut-off).
    """
    share, cutoff = float(row.values["side_share"]), float(row.values["alpha_cutoff"])
    if not looked:
        return row.error * error_unit(row.values, USUAL_DETAIL)
    of_cutoff = looked.get((1.0, cutoff), full.get(cutoff, row.error))
    of_size = 0.0 if share == 1.0 else looked[share, DEFAULT_CUTOFF]
    return SPREAD * (of_size + of_cutoff)


def looked_errors(command: "Render") -> dict[tuple[float, float], float]:
    """Mean square error of the frame in the middle by (share, cut-off), one of both changed."""
    from diff4splat.cli.common.precompile import precompile_renderer
    from diff4splat.cli.limits.measured import frame_error
    from diff4splat.io.checkpoints.import_scene import import_scene
    from diff4splat.progress.phases import Phases
    from diff4splat.render.api import DEFAULTS, render

    scene = import_scene(command.scene).scene
    precompile_renderer(scene.gaussians, Phases())
    path = command.chosen_path(scene)
    middle = len(path) // 2
    time_s = float(path.times_s[middle]) if command.time is None else command.time

    def frame(share: float, cutoff: float) -> "Tensor":
        settings = replace(DEFAULTS, alpha_cutoff=cutoff)
        return render(scene, at_share(path, share).cameras[middle], time_s, settings=settings).rgb

    exact = frame(1.0, min(CUTOFFS))
    changes = [(share, DEFAULT_CUTOFF) for share in SIDE_SHARES[1:]]
    changes += [(1.0, cutoff) for cutoff in LOOKED_CUTOFFS]
    return {change: frame_error(frame(*change), exact) for change in changes}
