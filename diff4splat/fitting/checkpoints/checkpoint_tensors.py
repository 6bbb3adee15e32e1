"""Whether a checkpoint holds the tensors of the fit that reads it, before any is used.

Axes: ``n`` Gaussians.
"""

from collections.abc import Mapping

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.errors import CheckpointError
from diff4splat.fitting.checkpoints.checkpoint import FitState
from diff4splat.fitting.model.canonical import COLUMNS, params_from_gaussians
from diff4splat.fitting.motions.protocol import LearnedMotion
from diff4splat.fitting.optics.learned import LearnedOptics
from diff4splat.fitting.parameter_table import MOMENTS
from diff4splat.fitting.settings import FitSettings
from diff4splat.scene.gaussians import Gaussians

STATISTICS = ("pull_total", "pull_seen")
"""Gradient statistics of the stage, one value per Gaussian."""


def require_tensors(
    state: FitState,
    motion: LearnedMotion,
    optics: LearnedOptics,
    settings: FitSettings,
) -> None:
    """Require every parameter, its Adam state and the statistics, in the shapes of this fit.

    Raises:
        CheckpointError: names the first that is missing or different.
    """
    count = len(state.moving_mask)
    for name, start in _parameters(count, motion, optics, settings).items():
        _require(name, state.tensors.get(name), start)
        kept = {key: state.tensors.get(f"{name}/{key}") for key in ("step", *MOMENTS)}
        if any(value is not None for value in kept.values()):
            _require(f"{name}/step", kept["step"], torch.zeros(()))
            for moment in MOMENTS:
                _require(f"{name}/{moment}", kept[moment], start)
    for name in STATISTICS:
        _require(name, state.fixed.get(name), torch.zeros(count, dtype=settings.torch_dtype))


def stored_bounds(state: FitState, dtype: torch.dtype) -> Float[Tensor, "2 3"]:
    """Bounds of the planes of the fine stage.

    Raises:
        CheckpointError: missing or of another shape.
    """
    _require("bounds", state.fixed.get("bounds"), torch.zeros(2, 3, dtype=dtype))
    return state.fixed["bounds"]


def _parameters(
    count: int, motion: LearnedMotion, optics: LearnedOptics, settings: FitSettings
) -> Mapping[str, Tensor]:
    """Tensors in the shapes and the dtype of all parameters."""
    rows = params_from_gaussians(_blank(count), settings.harmonics)
    columns = {name: rows[name] for name in COLUMNS} | dict(motion.columns(count))
    all_of = columns | dict(motion.shared()) | optics.shared()
    return {name: value.to(settings.torch_dtype) for name, value in all_of.items()}


def _blank(count: int) -> Gaussians:
    return Gaussians(
        means=torch.zeros(count, 3),
        quats=torch.zeros(count, 4),
        scales=torch.ones(count, 3),
        opacities=torch.zeros(count),
        sh=torch.zeros(count, 1, 3),
    )


def _require(name: str, found: Tensor | None, like: Tensor) -> None:
    wanted, got = _described(like), "none" if found is None else _described(found)
    if got != wanted:
        raise CheckpointError(
            f"checkpoint: {name}: expected {wanted}, got {got}; it is damaged or of another "
            "release, start again with --restart"
        )


def _described(tensor: Tensor) -> str:
    return f"{str(tensor.dtype)[6:]} of shape {tuple(tensor.shape)}"
