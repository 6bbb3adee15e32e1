"""Work and settings of ``diff4splat bake``: how many pixels key frames may be off.

The error is that of frames rendered from the key frames, against the exact motion.
"""

from typing import TYPE_CHECKING

from diff4splat.cli.limits.costing import Costing, Promise
from diff4splat.cli.limits.scene_header import SceneHeader, read_scene_header
from diff4splat.outputs.budgets.choose import agrees
from diff4splat.outputs.budgets.limits import loss_from_error
from diff4splat.outputs.budgets.table import SettingValues

if TYPE_CHECKING:
    from torch import Tensor

    from diff4splat.cli.scenes.bake import Bake
    from diff4splat.scene.scene import Scene

NAME = "bake"
DEFAULT_PX = 0.1
TOLERANCES_PX = (0.02, 0.05, DEFAULT_PX, 0.2, 0.5, 1.0, 2.0)
PROBES = 5
"""Times at which the loss is measured: between the keys and at them."""
PROBES_PER_GAP, PROBES_OF_ALL = 5, 32
"""Times at which a bake looks, as in ``scene/motion/bake_sampling.py``."""
ROUNDS, MOST_KEYS_PER_NODE = 3, 3
"""How often gaps of a field are split, usually, and how far."""


def request_work(command: "Bake", values: SettingValues | None = None) -> dict[str, float | int]:
    """Counted from the scene's header: at how many times which Gaussians are compared."""
    header = read_scene_header(command.scene)
    px = DEFAULT_PX if values is None else float(values["tolerance_px"])
    keys = command.keys or expected_keys(header, command.tolerance_px or px)
    probes = probe_count(header, keys)
    return {
        "start": 1,
        "gaussians": header.gaussians * (1 + header.bases / 4),
        f"states {header.motion}": probes,
        f"moved_gaussians {header.motion}": probes * header.moving,
        "compared_views": probes * header.views,
        "compared_gaussians": probes * header.views * header.moving,
        "held_keys": keys * header.moving,
    }


def expected_keys(header: SceneHeader, tolerance_px: float | int) -> float | int:
    """Key frames that a tolerance needs.

    Key frames need their own, and native 4D Gaussians move along lines. Between the nodes of planes
    a motion is smooth: there the error of a line is the square of the distance of its keys.
    """
    if header.motion == "keyframes":
        return max(header.time_nodes, 2)
    if header.motion != "hexplane":
        return 2
    per_node = (DEFAULT_PX / tolerance_px) ** 0.5
    return max(header.time_nodes * min(per_node, MOST_KEYS_PER_NODE), 2)


def probe_count(header: SceneHeader, keys: float | int) -> float | int:
    """Times at which key frames are held against the motion: over the range, then in each gap."""
    rounds = ROUNDS if header.motion == "hexplane" else 1
    return rounds * (PROBES_OF_ALL + header.time_nodes) + PROBES_PER_GAP * max(keys - 1, 0)


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
    from diff4splat.cli.limits.measured import frame_error

    pairs = list(zip(path_frames(other), path_frames(exact), strict=True))
    return sum(frame_error(frame, one) for frame, one in pairs) / len(pairs)


def path_frames(scene: "Scene") -> list["Tensor"]:
    """``PROBES`` frames inside the path; fewer where it has fewer."""
    import torch

    from diff4splat.render.api import render

    path = scene.path
    indices = torch.linspace(0, len(path) - 1, PROBES + 2).round().long()[1:-1].unique()
    return [render(scene, path.cameras[k], float(path.times_s[k])).rgb for k in indices.tolist()]
