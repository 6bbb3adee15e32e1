"""Key frames as operators; the formulas are those of ``scene/motion/keyframes``.

Axes: ``t`` key times, ``m`` moving Gaussians.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.geometry import quaternion
from diff4splat.io.scene_onnx.graph import GraphBuilder, moments
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.keyframes import KeyframeMotion

_NEARBY = 1 - 1e-6


def add_keyframes(
    builder: GraphBuilder, gaussians: Gaussians, motion: KeyframeMotion
) -> dict[str, str]:
    """New values of the means, quaternions and scales of the moving Gaussians."""
    moving = gaussians.select(motion.moving_index)
    lower, upper, weight = _bracket(builder, motion)
    turned = _slerp(builder, motion.rotations, (lower, upper, weight))
    canonical = moments(builder, "moving_quats", quaternion.normalize(moving.quats))
    stretch = builder.add(
        "Exp", _lerp(builder, "log_scales", motion.log_scale_offsets, (lower, upper, weight))
    )
    offset = _offset(builder, motion, (lower, upper, weight))
    return {
        "means": builder.add("Add", moments(builder, "moving_means", moving.means), offset),
        "quats": _multiply(builder, canonical, turned),
        "scales": builder.add("Mul", moments(builder, "moving_scales", moving.scales), stretch),
    }


def _bracket(builder: GraphBuilder, motion: KeyframeMotion) -> tuple[str, str, str]:
    """Numbers of the keys around the time, and the weight of the later one."""
    last = max(len(motion.key_times_s) - 2, 0)
    times = moments(builder, "key_times_s", motion.key_times_s)
    reached = builder.add("LessOrEqual", times, "time_s")
    count = builder.add("ReduceSum", builder.add("Cast", reached, to=7), keepdims=1)
    before = builder.add("Sub", count, builder.constant("one", [1]))
    low, high = builder.constant("first_key", [0]), builder.constant("last_gap", [last])
    lower = builder.add("Max", builder.add("Min", before, high), low)
    step = builder.constant("step", [min(1, len(motion.key_times_s) - 1)])
    upper = builder.add("Add", lower, step)
    start, stop = builder.add("Gather", times, lower), builder.add("Gather", times, upper)
    gap = builder.add("Sub", stop, start)
    if len(motion.key_times_s) == 1:
        gap = builder.constant("no_gap", torch.tensor([1.0]))
    share = builder.add("Div", builder.add("Sub", "time_s", start), gap)
    bounds = (
        builder.constant("zero", torch.tensor(0.0)),
        builder.constant("full", torch.tensor(1.0)),
    )
    return lower, upper, builder.add("Clip", share, *bounds)


def _pair(builder: GraphBuilder, name: str, keys: Tensor, at: tuple[str, str, str]) -> list[str]:
    """The rows of both keys, m × c."""
    stored = moments(builder, name, keys)
    axis = builder.constant("axis_0", [0])
    return [
        builder.add("Squeeze", builder.add("Gather", stored, index, axis=0), axis)
        for index in at[:2]
    ]


def _lerp(
    builder: GraphBuilder, name: str, keys: Float[Tensor, "t m c"], at: tuple[str, str, str]
) -> str:
    start, stop = _pair(builder, name, keys, at)
    return builder.add("Add", start, builder.add("Mul", builder.add("Sub", stop, start), at[2]))


def _offset(builder: GraphBuilder, motion: KeyframeMotion, at: tuple[str, str, str]) -> str:
    if motion.interpolation == "linear" or len(motion.key_times_s) < 3:
        return _lerp(builder, "offsets", motion.offsets, at)
    start, stop = _pair(builder, "offsets", motion.offsets, at)
    tangents = _pair(builder, "tangents", _tangents(motion), at)
    times = [builder.add("Gather", "key_times_s", index) for index in at[:2]]
    gap, w = builder.add("Sub", times[1], times[0]), at[2]
    w2 = builder.add("Mul", w, w)
    powers = [builder.add("Mul", w2, w), w2, w]
    terms = [
        builder.add("Mul", start, _polynomial(builder, powers, (2, -3, 0, 1))),
        builder.add("Mul", stop, _polynomial(builder, powers, (-2, 3, 0, 0))),
    ]
    for tangent, factors in zip(tangents, ((1, -2, 1, 0), (1, -1, 0, 0)), strict=True):
        rate = builder.add("Mul", gap, _polynomial(builder, powers, factors))
        terms.append(builder.add("Mul", tangent, rate))
    return builder.add("Sum", *terms)


def _tangents(motion: KeyframeMotion) -> Float[Tensor, "t m 3"]:
    """Velocities at the keys: central differences, one-sided at the ends."""
    last = len(motion.key_times_s) - 1
    lower = torch.arange(last + 1).sub(1).clamp_min(0)
    upper = torch.arange(last + 1).add(1).clamp_max(last)
    gaps = motion.key_times_s[upper] - motion.key_times_s[lower]
    return (motion.offsets[upper] - motion.offsets[lower]) / gaps[:, None, None]


def _polynomial(builder: GraphBuilder, powers: list[str], factors: tuple[int, ...]) -> str:
    """Of w³, w², w and 1."""
    names = [builder.constant(f"factor_{f}", torch.tensor([float(f)])) for f in factors]
    products = [builder.add("Mul", p, f) for p, f in zip(powers, names, strict=False)]
    return builder.add("Sum", *products, names[3])


def _slerp(builder: GraphBuilder, keys: Float[Tensor, "t m 4"], at: tuple[str, str, str]) -> str:
    start, stop = _pair(builder, "rotations", quaternion.normalize(keys), at)
    axis = builder.constant("last_axis", [1])
    cosine = builder.add("ReduceSum", builder.add("Mul", start, stop), axis, keepdims=1)
    zero, full = "zero", "full"
    stop = builder.add("Where", builder.add("Less", cosine, zero), builder.add("Neg", stop), stop)
    cosine = builder.add("Abs", cosine)
    nearby = builder.add("Greater", cosine, builder.constant("nearby", torch.tensor(_NEARBY)))
    half = builder.constant("half", torch.tensor(0.5))
    angle = builder.add("Acos", builder.add("Where", nearby, half, cosine))
    weights = (builder.add("Sub", full, at[2]), at[2])
    sine = builder.add("Sin", angle)
    shares = [
        builder.add(
            "Where",
            nearby,
            weight,
            builder.add("Div", builder.add("Sin", builder.add("Mul", angle, weight)), sine),
        )
        for weight in weights
    ]
    mixed = builder.add(
        "Add", builder.add("Mul", start, shares[0]), builder.add("Mul", stop, shares[1])
    )
    length = builder.add("ReduceL2", mixed, axis, keepdims=1)
    return builder.add("Div", mixed, length)


def _multiply(builder: GraphBuilder, left: str, right: str) -> str:
    """The Hamilton product: each component of the left times a signed order of the right."""
    orders = ((0, 1, 2, 3), (1, 0, 3, 2), (2, 3, 0, 1), (3, 2, 1, 0))
    signs = ((1, 1, 1, 1), (-1, 1, -1, 1), (-1, 1, 1, -1), (-1, -1, 1, 1))
    terms = []
    for place, (order, sign) in enumerate(zip(orders, signs, strict=True)):
        part = builder.add("Gather", left, builder.constant(f"place_{place}", [place]), axis=1)
        index = builder.constant(f"order_{place}", list(order))
        turned = builder.add("Gather", right, index, axis=1)
        signed = builder.constant(f"sign_{place}", torch.tensor(sign, dtype=torch.float32))
        terms.append(builder.add("Mul", part, builder.add("Mul", turned, signed)))
    return builder.add("Sum", *terms)
