"""Work and settings of ``diff4splat export html``: what a page leaves out of a scene."""

from dataclasses import replace
from typing import TYPE_CHECKING

from diff4splat.cli.limits.baking import expected_keys, probe_count
from diff4splat.cli.limits.costing import Costing, Promise
from diff4splat.cli.limits.scene_header import SceneHeader, read_scene_header
from diff4splat.outputs.budgets.limits import loss_from_error
from diff4splat.outputs.budgets.table import SettingValues

if TYPE_CHECKING:
    from pathlib import Path

    from diff4splat.cli.limits.options import LimitOptions
    from diff4splat.scene.scene import Scene

HTML = "export html"
PAGE_PX = 0.1
"""Tolerance of a page's key frames, as in ``viewer/keyframed.py``."""
MIN_OPACITIES = (0.0, 0.005, 0.02, 0.05, 0.2)
DEGREES = (3, 2, 1, 0)


def html_work(source: "Path", values: SettingValues | None = None) -> dict[str, float | int]:
    """Counted from the scene's header: what is read, and what is packed."""
    header = read_scene_header(source)
    bases = header.bases
    if values is not None:
        bases = min(bases, (int(values["degree"]) + 1) ** 2)
    return {
        "start": 1,
        "gaussians": header.gaussians * (1 + header.bases / 4),
        "packed_gaussians": header.gaussians * (1 + bases / 4),
        "moved_gaussians": header.moving * max(header.frames, 1),
        **baked_work(header),
    }


def baked_work(header: SceneHeader) -> dict[str, float | int]:
    """A page plays key frames; any other motion is baked first."""
    if header.motion in ("static", "keyframes"):
        return {}
    probes = probe_count(header, expected_keys(header, PAGE_PX))
    return {f"baked_gaussians {header.motion}": probes * header.moving * header.frames}


def html_promise(source: "Path", options: "LimitOptions") -> Promise:
    """What the page is expected to need, with the setting that the limits ask for.

    Raises:
        ConfigError: no setting holds; says what is possible.
    """
    limits, costing = options.limits, Costing.of(options.calibration)
    plain = costing.promise(HTML, limits, html_work(source))
    if not limits.given:
        return plain
    work = lambda values: html_work(source, values)  # noqa: E731
    return plain.with_choice(costing.choose(HTML, work, lambda _: True, limits))


def reduced(scene: "Scene", values: SettingValues) -> "Scene":
    """The scene without what a setting leaves out."""
    kept = scene.gaussians.opacities >= float(values["min_opacity"])
    scene = scene.select(kept)
    bases = (int(values["degree"]) + 1) ** 2
    sh = scene.gaussians.sh[:, :bases]
    return replace(scene, gaussians=replace(scene.gaussians, sh=sh))


def html_loss_db(exact: "Scene", page: "Scene") -> float:
    """The loss of frames along the path."""
    from diff4splat.cli.limits.baking import frames_error

    return round(loss_from_error(frames_error(exact, page)), 4)
