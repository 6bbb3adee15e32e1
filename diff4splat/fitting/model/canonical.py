"""Unconstrained parameters of the canonical Gaussians, and their activation.

Axes: ``n`` Gaussians, ``k`` harmonics. Scales are stored as logarithms, opacities as
logits, and quaternions with any norm.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.data.capture.capture import PointCloud
from diff4splat.fitting.model.initial_points import mean_neighbour_distance
from diff4splat.fitting.parameter_table import ParameterTable
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.harmonics import BAND_SIZES, dc_from_color

COLUMNS = ("means", "log_scales", "quats", "opacity_logits", "sh_dc", "sh_rest")
INITIAL_OPACITY = 0.2
MIN_SCALE, MAX_SCALE = 1e-7, 1e4
"""In scene units; the square of a scale outside this range overflows or underflows float32."""
MAX_LOGIT = 14.0


def params_from_points(points: PointCloud, degree: int) -> dict[str, Tensor]:
    """Isotropic Gaussians at ``points``, as wide as the distance to their neighbours."""
    count = len(points.positions)
    size = mean_neighbour_distance(points.positions).clamp_min(1e-6)
    identity = torch.tensor([1.0, 0.0, 0.0, 0.0]).repeat(count, 1)
    return {
        "means": points.positions,
        "log_scales": size.log()[:, None].repeat(1, 3),
        "quats": identity,
        "opacity_logits": torch.full((count,), INITIAL_OPACITY).logit(),
        "sh_dc": dc_from_color(points.rgb)[:, None],
        "sh_rest": torch.zeros(count, BAND_SIZES[degree] - 1, 3),
    }


def params_from_gaussians(gaussians: Gaussians, degree: int) -> dict[str, Tensor]:
    """Parameters of existing Gaussians, with harmonics up to ``degree``."""
    count, rest = len(gaussians), BAND_SIZES[degree] - 1
    sh = gaussians.sh
    padded = torch.cat([sh[:, 1:], sh.new_zeros(count, max(rest - sh.shape[1] + 1, 0), 3)], 1)
    return {
        "means": gaussians.means,
        "log_scales": gaussians.scales.clamp(MIN_SCALE, MAX_SCALE).log(),
        "quats": gaussians.quats,
        "opacity_logits": gaussians.opacities.logit(1e-6),
        "sh_dc": sh[:, :1],
        "sh_rest": padded[:, :rest],
    }


def activate(table: ParameterTable, degree: int) -> Gaussians:
    """Gaussians with harmonics up to ``degree``; differentiable."""
    bands = BAND_SIZES[degree] - 1
    sh = table["sh_dc"]
    if bands:
        sh = torch.cat([sh, table["sh_rest"][:, :bands]], 1)
    return Gaussians(
        means=table["means"],
        quats=_unit(table["quats"]),
        scales=table["log_scales"].exp(),
        opacities=table["opacity_logits"].sigmoid(),
        sh=sh,
    )


def clamp_params(table: ParameterTable) -> None:
    """Clamp parameters to the range with finite values and gradients."""
    low, high = torch.tensor([MIN_SCALE, MAX_SCALE]).log().tolist()
    with torch.no_grad():
        table["log_scales"].clamp_(low, high)
        table["opacity_logits"].clamp_(-MAX_LOGIT, MAX_LOGIT)


def _unit(quats: Float[Tensor, "n 4"]) -> Float[Tensor, "n 4"]:
    return torch.nn.functional.normalize(quats, dim=-1, eps=1e-8)
