"""All checks of the report, by group."""

from collections.abc import Callable, Iterable, Sequence

from diff4splat.stability.check import Check
from diff4splat.stability.checks.camera_checks import camera_checks
from diff4splat.stability.checks.depth_checks import depth_checks
from diff4splat.stability.checks.fit_checks import fit_checks
from diff4splat.stability.checks.gaussian_checks import gaussian_checks
from diff4splat.stability.checks.image_checks import image_checks
from diff4splat.stability.checks.loss_checks import loss_checks
from diff4splat.stability.checks.motion_checks import motion_checks
from diff4splat.stability.checks.network_checks import network_checks
from diff4splat.stability.checks.onnx_checks import onnx_checks
from diff4splat.stability.checks.sampler_checks import sampler_checks
from diff4splat.stability.checks.sampling_checks import sampling_checks
from diff4splat.stability.checks.scene_checks import scene_checks
from diff4splat.stability.checks.threshold_checks import threshold_checks
from diff4splat.stability.checks.vae_checks import vae_checks
from diff4splat.stability.groups import GROUPS, require_groups

OF_MODEL: dict[str, Callable[[str], Iterable[Check]]] = {
    "networks": network_checks,
    "sampling": sampling_checks,
    "end-to-end": scene_checks,
    "long-videos": vae_checks,
    "images": image_checks,
    "onnx": onnx_checks,
    "thresholds": threshold_checks,
}
"""Checks of a model, which is a size or a folder."""
OF_LIBRARY: dict[str, Callable[[], Iterable[Check]]] = {
    "samplers": sampler_checks,
    "cameras": camera_checks,
    "depth": depth_checks,
    "motion": motion_checks,
    "gaussians": gaussian_checks,
    "losses": loss_checks,
    "fits": fit_checks,
}


def known_checks(
    only: Sequence[str] = (), *, model: str = "small", quick: bool = False
) -> list[Check]:
    """The checks of the groups ``only``, or of all; the quick subset has a few of each group.

    Raises:
        ConfigError: no such group, or a model without PyTorch weights.
    """
    require_groups(only)
    checks: list[Check] = []
    for name in GROUPS:
        if only and name not in only:
            continue
        if name in OF_MODEL:
            checks += OF_MODEL[name](model)
        else:
            checks += OF_LIBRARY[name]()
    return [check for check in checks if check.quick or not quick]
