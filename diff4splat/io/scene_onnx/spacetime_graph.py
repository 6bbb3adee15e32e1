"""Velocities, pulses and colour waves as operators, as in ``scene/motion/spacetime``."""

import math

import torch

from diff4splat.io.scene_onnx.graph import GraphBuilder, moments
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.spacetime import FARTHEST, SpacetimeMotion


def add_spacetime(
    builder: GraphBuilder, gaussians: Gaussians, motion: SpacetimeMotion
) -> dict[str, str]:
    """New values of the means, opacities and harmonics of the moving Gaussians."""
    moving = gaussians.select(motion.moving_index)
    start, stop = (torch.tensor(time_s) for time_s in motion.time_range_s)
    bounds = builder.constant("start_s", start), builder.constant("stop_s", stop)
    centers = moments(builder, "time_centers_s", motion.time_centers_s[:, None])
    elapsed = builder.add("Sub", builder.add("Clip", "time_s", *bounds), centers)
    moved = builder.add("Mul", moments(builder, "velocities", motion.velocities), elapsed)
    values = {
        "means": builder.add("Add", moments(builder, "moving_means", moving.means), moved),
        "opacities": _opacities(builder, moving, motion, elapsed),
    }
    if motion.color_waves is not None:
        values["sh"] = _colors(builder, moving, motion, elapsed)
    return values


def _opacities(
    builder: GraphBuilder, moving: Gaussians, motion: SpacetimeMotion, elapsed: str
) -> str:
    reach = math.sqrt(-2 * math.log(motion.gate)) if motion.gate > 0 else FARTHEST
    deviations = motion.time_deviations_s[:, None]
    limits = moments(builder, "reach_s", (reach * deviations.double()).clamp_max(3e38))
    inside = builder.add("Less", builder.add("Abs", elapsed), limits)
    ratio = builder.add("Div", elapsed, moments(builder, "time_deviations_s", deviations))
    zero = builder.constant("zero", torch.tensor(0.0))
    ratio = builder.add("Where", inside, ratio, zero)
    factor = builder.constant("minus_half", torch.tensor(-0.5))
    pulse = builder.add("Exp", builder.add("Mul", factor, builder.add("Mul", ratio, ratio)))
    pulse = builder.add("Where", inside, pulse, zero)
    there = builder.add("Mul", moments(builder, "peak", moving.opacities[:, None]), pulse)
    return builder.add("Squeeze", there, builder.constant("last_axis", [1]))


def _colors(builder: GraphBuilder, moving: Gaussians, motion: SpacetimeMotion, elapsed: str) -> str:
    waves, terms = motion.color_waves, [moments(builder, "moving_sh", moving.sh)]
    column = builder.add("Unsqueeze", elapsed, builder.constant("axis_2", [2]))
    for order in range(waves.shape[1]):
        rate = builder.constant(
            f"rate_{order}", torch.tensor(2 * math.pi * (order + 1) / motion.period_s)
        )
        phase = builder.add("Cos", builder.add("Mul", column, rate))
        wave = moments(builder, f"wave_{order}", waves[:, order])
        terms.append(builder.add("Mul", phase, wave))
    return builder.add("Sum", *terms)
