"""Fused and shrunk depth of extreme maps, float32 against float64.

Axes: ``p`` passes, ``e`` encoders, ``h w`` pixels of log depth.
"""

from collections.abc import Iterator
from functools import partial

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.generation.depth.fusion import fused, out_of_domain_score
from diff4splat.generation.depth.shrinkage import shrunk
from diff4splat.models.monocular_depth.uncertainty import LOG_LIMITS
from diff4splat.stability.check import Check, Outcome
from diff4splat.stability.compare import all_finite, relative_error

GROUP = "depth"
LIMIT = 1e-4
SIZE = (48, 64)
PASSES = 4

Maps = Float[Tensor, "p e h w"]


def depth_checks() -> Iterator[Check]:
    """One check per kind of maps."""
    for name, maps in _kinds().items():
        yield Check(
            group=GROUP,
            name=name,
            run=partial(measure_depth, maps),
            limit=LIMIT,
            error_unit="largest difference over largest value",
        )


def measure_depth(maps: Maps) -> Outcome:
    """Surest and least sure by turns, from pixel to pixel."""
    got, exact = (_log_depth(maps.to(dtype)) for dtype in (torch.float32, torch.float64))
    return Outcome(
        error=relative_error(got, exact),
        value_finite=all_finite([got]),
        note=f"out of domain {float(out_of_domain_score(maps)):.2g}",
    )


def _log_depth(maps: Maps) -> Float[Tensor, "h w"]:
    log_scale = torch.full_like(maps[0, 0], LOG_LIMITS[0])
    log_scale[::2, ::2] = LOG_LIMITS[1]
    score = out_of_domain_score(maps)
    return shrunk(fused(maps, score), log_scale.exp(), score, _two_colors(maps))


def _two_colors(maps: Maps) -> Float[Tensor, "h w 3"]:
    """An edge through the middle, which depth knows nothing of."""
    rgb = maps.new_zeros(*maps.shape[2:], 3)
    rgb[:, rgb.shape[1] // 2 :] = 1.0
    return rgb


def _kinds() -> dict[str, Maps]:
    """Maps of two encoders, but for one kind."""
    generator = torch.Generator().manual_seed(0)
    noise = torch.randn(PASSES, 2, *SIZE, generator=generator)
    alike = noise[:1, :1].expand(PASSES, 2, *SIZE)
    opposite = torch.cat([noise[:, :1], 1e-3 * noise[:, 1:] - noise[:, :1]], 1)
    one = torch.zeros_like(noise)
    one[:, 0, 0, 0] = 4.0
    return {
        "encoders that agree": alike,
        "encoders that know nothing of each other": noise,
        "encoders that contradict each other": opposite,
        "one encoder": noise[:, :1],
        "flat maps": torch.full_like(noise, 4.0),
        "one pixel of one encoder": one,
        "relief of 1e-6": 1e-6 * noise,
        "relief of 1e-30": 1e-30 * noise,
        "relief of 60": 60 * noise,
        "a step of 60 beside an offset of 60": 60 + 60 * noise.sign(),
    }
