"""Raw numbers of the canonical Gaussians, and the Gaussians they stand for.

Axes: ``n`` Gaussians, ``k`` harmonics. Raw values have no bounds: logarithms of scales, logits of
opacities, quaternions of any length.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.data.capture.capture import PointCloud
from diff4splat.fitting.parameter_table import ParameterTable
from diff4splat.fitting.points import spacing
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.harmonics import BAND_SIZES, dc_from_color

COLUMNS = ("means", "log_scales", "quats", "opacity_logits", "sh_dc", "sh_rest")
STARTING_OPACITY = 0.2
LEAST_SCALE, MOST_SCALE = 1e-7, 1e4
"""In scene units; exp of anything beyond could not be squared."""
MOST_LOGIT = 14.0


def raw_points(points: PointCloud, degree: int) -> dict[str, Tensor]:
    """Round, faint Gaussians at ``points``, as wide as these lie apart."""
    count = len(points.positions)
    size = spacing(points.positions).clamp_min(1e-6)
    unturned = torch.tensor([1.0, 0.0, 0.0, 0.0]).repeat(count, 1)
    return {
        "means": points.positions.float(),
        "log_scales": size.log()[:, None].repeat(1, 3),
        "quats": unturned,
        "opacity_logits": torch.full((count,), STARTING_OPACITY).logit(),
        "sh_dc": dc_from_color(points.rgb.float())[:, None],
        "sh_rest": torch.zeros(count, BAND_SIZES[degree] - 1, 3),
    }


def raw_gaussians(gaussians: Gaussians, degree: int) -> dict[str, Tensor]:
    """The numbers of ready Gaussians, with harmonics up to ``degree``."""
    count, rest = len(gaussians), BAND_SIZES[degree] - 1
    sh = gaussians.sh.float()
    padded = torch.cat([sh[:, 1:], sh.new_zeros(count, max(rest - sh.shape[1] + 1, 0), 3)], 1)
    return {
        "means": gaussians.means.float(),
        "log_scales": gaussians.scales.float().clamp(LEAST_SCALE, MOST_SCALE).log(),
        "quats": gaussians.quats.float(),
        "opacity_logits": gaussians.opacities.float().logit(1e-6),
        "sh_dc": sh[:, :1],
        "sh_rest": padded[:, :rest],
    }


def activated(table: ParameterTable, degree: int) -> Gaussians:
    """The Gaussians with harmonics up to ``degree``; differentiable."""
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


def bound(table: ParameterTable) -> None:
    """Pull raw numbers back to where their values and gradients are finite."""
    low, high = torch.tensor([LEAST_SCALE, MOST_SCALE]).log().tolist()
    with torch.no_grad():
        table["log_scales"].clamp_(low, high)
        table["opacity_logits"].clamp_(-MOST_LOGIT, MOST_LOGIT)


def _unit(quats: Float[Tensor, "n 4"]) -> Float[Tensor, "n 4"]:
    return torch.nn.functional.normalize(quats, dim=-1, eps=1e-8)
