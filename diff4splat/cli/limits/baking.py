"""Work and settings of ``diff4splat bake``: how many pixels key frames may be off.

The error is that of frames rendered from the key frames, against the exact motion.
"""

from typing import TYPE_CHECKING

from diff4splat.cli.limits.costing import Costing, Promise
from diff4splat.cli.limits.scene_header import read_scene_header
from diff4splat.outputs.budgets.choose import agrees
from diff4splat.outputs.budgets.limits import loss_from_error
from diff4splat.outputs.budgets.table import SettingValues

if TYPE_CHECKING:
    from diff4splat.cli.scenes.bake import Bake
    from diff4splat.scene.scene import Scene

NAME = "bake"
DEFAULT_PX = 0.1
TOLERANCES_PX = (0.02, 0.05, DEFAULT_PX, 0.2, 0.5, 1.0, 2.0)
PROBES = 5
"""Times at which the loss is measured: between the keys and at them."""


def request_work(command: "Bake", values: SettingValues | None = None) -> dict[str, float | int]:
    """Counted from the scene's header; key frames grow as one over the root of the tolerance."""
    header = read_scene_header(command.scene)
    px = DEFAULT_PX if values is None else float(values["tolerance_px"])
    px = command.tolerance_px or px
    keys = px**-0.5 if command.keys is None else command.keys
    return {
        "start": 1,
        "gaussians": header.gaussians * (1 + header.bases / 4),
        "baked_gaussians": header.moving * keys,
    }


def promise(command: "Bake") -> Promise:
    """What the command is expected to need, with the setting that its limits ask for.

    Raises:
        ConfigError: no setting holds; says what is possible.
    """
    limits, costing = command.limits.limits, Costing.of(command.limits.calibration)
    plain = costing.promise(NAME, limits, request_work(command))
    if not limits.given:
        return plain
    fixed = {"motion": read_scene_header(command.scene).motion}
    if command.tolerance_px is not None:
        fixed["tolerance_px"] = command.tolerance_px
    allowed = lambda values: command.keys is None and agrees(values, fixed)  # noqa: E731
    work = lambda values: request_work(command, values)  # noqa: E731
    return plain.with_choice(costing.choose(NAME, work, allowed, limits))


def chosen_px(command: "Bake", promised: Promise) -> float:
    """The tolerance in pixels: given, chosen, or the default."""
    if command.tolerance_px is not None:
        return command.tolerance_px
    chosen = promised.choice
    return DEFAULT_PX if chosen is None else float(chosen.values["tolerance_px"])


def measured_loss_db(exact: "Scene", baked: "Scene") -> float:
    """The loss of frames of the path at even times."""
    return round(loss_from_error(frames_error(exact, baked)), 4)


def frames_error(exact: "Scene", other: "Scene") -> float:
    """Mean square difference of ``PROBES`` frames along the path."""
    import torch

    from diff4splat.render.api import render

    path, errors = exact.path, []
    for index in torch.linspace(0, len(path) - 1, PROBES + 2).round().long().tolist()[1:-1]:
        camera, time_s = path.cameras[index], float(path.times_s[index])
        frames = [render(scene, camera, time_s).rgb.clamp(0, 1) for scene in (exact, other)]
        errors.append((frames[0] - frames[1]).square().mean())
    return float(torch.stack(errors).mean())
