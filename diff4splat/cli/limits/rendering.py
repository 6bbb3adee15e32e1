"""Work and settings of ``diff4splat render``, counted from the header of the scene file.

Settings are the cut-off of contributions and how many pixels are rendered for one of the output.
"""

from dataclasses import replace
from typing import TYPE_CHECKING

from diff4splat.cli.limits.costing import Costing, Promise
from diff4splat.cli.limits.scene_header import SceneHeader, read_scene_header
from diff4splat.outputs.budgets.choose import agrees
from diff4splat.outputs.budgets.limits import loss_from_error
from diff4splat.outputs.budgets.table import SettingValues

if TYPE_CHECKING:
    from diff4splat.cli.scenes.render import Render
    from diff4splat.paths.camera_path import CameraPath
    from diff4splat.render.settings import RenderSettings
    from diff4splat.scene.scene import Scene

NAME = "render"
USUAL_DETAIL = 1e-3
"""Of a frame, where it is not measured: with a budget alone, only the order of errors counts."""
FEW_FRAMES = 8
"""For fewer, looking at the one in the middle costs more than a cheaper setting saves."""
DEFAULT_CUTOFF = 1 / 255
CUTOFFS = (1 / 4096, 1 / 1024, DEFAULT_CUTOFF, 1 / 64, 1 / 16)
SIDE_SHARES = (1.0, 0.75, 0.5)
MOVING = 3
"""Moving Gaussians are moved, projected and sorted for each frame, static ones once per camera."""


def work(
    header: SceneHeader, frames: int, size_px: tuple[int, int], cutoff: float = DEFAULT_CUTOFF
) -> dict[str, float | int]:
    """Counted work of filming a scene at (height, width)."""
    pixels = size_px[0] * size_px[1]
    footprints = reach(cutoff)
    return {
        "start": 1,
        "gaussians": header.gaussians * (1 + header.bases / 4),
        "filmed_gaussians": (header.gaussians + MOVING * header.moving) * frames * footprints,
        "filmed_pixels": pixels * frames,
    }


def reach(cutoff: float) -> float:
    """Area of footprints of opacity 1 against the default cut-off: it grows as -log."""
    from math import log

    return log(cutoff) / log(DEFAULT_CUTOFF)


def request_work(command: "Render", values: SettingValues | None = None) -> dict[str, float | int]:
    """The same from the options alone and the scene's header."""
    from diff4splat.cli.scenes.render import longer_side

    header = read_scene_header(command.scene)
    share, cutoff = (1.0, DEFAULT_CUTOFF) if values is None else _parts(values)
    size_px = header.size_px
    if command.resolution is not None and max(size_px) > 0:
        size_px = longer_side(size_px, command.resolution)
    size_px = tuple(round(side * share) for side in size_px)
    return work(header, frame_count(command), size_px, cutoff)


def frame_count(command: "Render") -> int:
    """Frames that are written."""
    from diff4splat.cli.options.camera import PRESET_FRAMES

    if command.out.suffix.lower() == ".png" and "%" not in command.out.name:
        return 1
    own = read_scene_header(command.scene).frames if command.camera is None else PRESET_FRAMES
    return command.options.frames or own


def promise(command: "Render") -> Promise:
    """What the command is expected to need, with the settings that its limits ask for.

    With a tolerance, the frame in the middle is rendered to see what this scene loses.

    Raises:
        ConfigError: no setting holds; says what is possible.
        InputError, FileFormatError: the scene cannot be read.
    """
    from diff4splat.cli.limits.looking import expected_error, looked_errors

    limits, costing = command.limits.limits, Costing.of(command.limits.calibration)
    plain = costing.promise(NAME, limits, request_work(command))
    if not limits.given:
        return plain
    fixed = {} if command.resolution is None else {"side_share": 1.0}
    looked: dict[tuple[float, float], float] = {}
    if limits.tolerance_db is not None and frame_count(command) >= FEW_FRAMES:
        looked = looked_errors(command)
    elif limits.tolerance_db is not None:
        fixed = {"side_share": 1.0}
    full = {
        row.values["alpha_cutoff"]: row.error
        for row in costing.table.of(NAME)[1]
        if row.values["side_share"] == 1.0
    }
    return plain.with_choice(
        costing.choose(
            NAME,
            lambda values: request_work(command, values),
            lambda values: agrees(values, fixed),
            limits,
            lambda row: expected_error(row, full, looked),
        )
    )


def error_unit(values: SettingValues, detail: float) -> float:
    """What errors of the table are shares of: the frame's detail where frames are smaller."""
    return 1.0 if values["side_share"] == 1.0 else detail


def apply(promised: Promise, path: "CameraPath") -> tuple["CameraPath", "RenderSettings"]:
    """The path at the chosen size, and how its frames are rendered."""
    from diff4splat.render.api import DEFAULTS

    if promised.choice is None:
        return path, DEFAULTS
    share, cutoff = _parts(promised.choice.values)
    return at_share(path, share), replace(DEFAULTS, alpha_cutoff=cutoff)


def at_share(path: "CameraPath", share: float) -> "CameraPath":
    """The path with sides of a share of its own."""
    from diff4splat.paths.resize import resized

    if share == 1.0:
        return path
    return resized(path, tuple(max(round(side * share), 1) for side in path.cameras.size_px))


def measured_loss_db(
    scene: "Scene", paths: tuple["CameraPath", "CameraPath"], settings: "RenderSettings"
) -> float:
    """The loss in the middle of the path: (reference path, path of the chosen size)."""
    from diff4splat.cli.limits.measured import frame_error
    from diff4splat.render.api import DEFAULTS, render

    full, chosen = paths
    middle = len(full) // 2
    time_s = float(full.times_s[middle])
    exact = replace(DEFAULTS, alpha_cutoff=min(CUTOFFS))
    reference = render(scene, full.cameras[middle], time_s, settings=exact).rgb
    frame = render(scene, chosen.cameras[middle], time_s, settings=settings).rgb
    return round(loss_from_error(frame_error(frame, reference)), 4)


def _parts(values: SettingValues) -> tuple[float, float]:
    return float(values["side_share"]), float(values["alpha_cutoff"])
