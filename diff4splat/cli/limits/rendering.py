"""Work and settings of ``diff4splat render``, counted from the header of the scene file.

Settings are the cut-off of contributions and how many pixels are rendered for one of the output.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from diff4splat.cli.limits.costing import Costing, Promise
from diff4splat.cli.limits.scene_header import SceneHeader, read_scene_header
from diff4splat.outputs.budgets.choose import agrees
from diff4splat.outputs.budgets.limits import loss_from_error
from diff4splat.outputs.budgets.table import SettingRow, SettingValues

if TYPE_CHECKING:
    from diff4splat.cli.scenes.render import Render
    from diff4splat.paths.camera_path import CameraPath
    from diff4splat.render.settings import RenderSettings
    from diff4splat.scene.scene import Scene

NAME = "render"
USUAL_DETAIL = 1e-3
"""Of a frame, where it is not measured: with a budget alone, only the order of errors counts."""
FEW_FRAMES, LOOKS = 8, (1 / 3, 2 / 3)
"""With fewer frames, looking at two of them, at these places, costs more than smaller ones save."""
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

    With a tolerance, two frames are rendered to see how much smaller ones lose of this scene.

    Raises:
        ConfigError: no setting holds; says what is possible.
        InputError, FileFormatError: the scene cannot be read.
    """
    limits, costing = command.limits.limits, Costing.of(command.limits.calibration)
    plain = costing.promise(NAME, limits, request_work(command))
    if not limits.given:
        return plain
    full_size = command.resolution is not None or (
        limits.tolerance_db is not None and frame_count(command) < FEW_FRAMES
    )
    units = dict.fromkeys(SIDE_SHARES, USUAL_DETAIL) | {1.0: 1.0}
    if limits.tolerance_db is not None and not full_size:
        units |= measured_units(command, costing.table.of(NAME)[1])
    fixed = {"side_share": 1.0} if full_size else {}
    return plain.with_choice(
        costing.choose(
            NAME,
            lambda values: request_work(command, values),
            lambda values: agrees(values, fixed),
            limits,
            lambda values: units[values["side_share"]],
        )
    )


def measured_units(command: "Render", rows: Sequence[SettingRow]) -> dict[float, float]:
    """By how much errors of the table at each smaller share count for this scene."""
    listed = {
        row.values["side_share"]: row.error
        for row in rows
        if row.values["alpha_cutoff"] == DEFAULT_CUTOFF
    }
    errors = share_errors(command)
    return {share: error / max(listed.get(share, 1.0), 1e-9) for share, error in errors.items()}


def share_errors(command: "Render") -> dict[float, float]:
    """Mean square error of smaller frames, the larger of two places on the path."""
    from diff4splat.cli.common.precompile import precompile_renderer
    from diff4splat.cli.limits.measured import frame_error
    from diff4splat.io.checkpoints.import_scene import import_scene
    from diff4splat.progress.phases import Phases
    from diff4splat.render.api import render

    scene = import_scene(command.scene).scene
    precompile_renderer(scene.gaussians, Phases())
    path = command.chosen_path(scene)
    errors = dict.fromkeys(SIDE_SHARES[1:], 0.0)
    for place in LOOKS:
        index = int(place * (len(path) - 1))
        time_s = float(path.times_s[index]) if command.time is None else command.time
        exact = render(scene, path.cameras[index], time_s).rgb
        for share in errors:
            frame = render(scene, at_share(path, share).cameras[index], time_s).rgb
            errors[share] = max(errors[share], frame_error(frame, exact))
    return errors


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
