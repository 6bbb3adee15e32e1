"""Tracing as one differentiable operation on float32 CPU tensors.

Axes: ``n`` Gaussians, ``k`` harmonics, ``r`` rays, 7 columns as in `shade`.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn.functional import pad

from diff4splat.kernels.simd16 import LANES
from diff4splat.render.saturate import saturate_
from diff4splat.render.trace.backward import Gradients, gradients
from diff4splat.render.trace.bvh.tree import NO_ORDER
from diff4splat.render.trace.forward import make_inputs, make_rules, make_scene, shade_rays
from diff4splat.render.trace.moving import MovingCloud
from diff4splat.render.trace.rays import Rays
from diff4splat.render.trace.reference import RayOutputs
from diff4splat.render.trace.settings import TraceSettings
from diff4splat.render.trace.shading.sh_color import PLAIN_COLUMNS
from diff4splat.render.trace.shading.shade import DISTANCE, LIGHT, MEDIAN, RGB, WEIGHT
from diff4splat.render.trace.tables import Cloud, Floats, Integers, MotionArrays, TraceInputs
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.harmonics import DEGREE_ZERO


@dataclass(frozen=True, slots=True, kw_only=True)
class _Arrays:
    """The inputs as kernels read them."""

    cloud: Cloud
    sh: Tensor
    motion: MotionArrays
    origins: Floats
    directions: Floats
    times: Floats


def trace_compiled(
    gaussians: Gaussians,
    rays: Rays,
    settings: TraceSettings,
    moving: MovingCloud | None,
    order: Integers = NO_ORDER,
) -> RayOutputs:
    """Outputs along valid ``rays`` through valid ``gaussians``.

    ``order`` is an order of the Gaussians in which neighbours follow each other.
    """
    means = gaussians.means
    motion = (means.new_empty(0, 3), means.new_empty(0), means.new_empty(0))
    times, gate = means.new_empty(0), None
    if moving is not None and rays.time_s is not None:
        motion = moving.velocities, moving.time_centers_s, moving.time_deviations_s
        times, gate = rays.time_s, moving.gate_reach**2
    table, hits = _Trace.apply(
        settings,
        gate,
        order,
        *(means, gaussians.quats, gaussians.scales, gaussians.opacities, gaussians.sh),
        *motion,
        *(rays.origins, rays.directions, times),
    )
    return RayOutputs(
        rgb=table[:, RGB : RGB + 3],
        distance_sum=table[:, DISTANCE],
        weight=table[:, WEIGHT],
        light=table[:, LIGHT],
        median=table[:, MEDIAN],
        hits=hits,
    )


class _Trace(torch.autograd.Function):
    @staticmethod
    def forward(
        ctx: Any,
        settings: TraceSettings,
        squared_gate: float | None,
        order: Integers,
        *tensors: Tensor,
    ) -> tuple[Tensor, Tensor]:
        inputs = _inputs(_unpack(tensors), settings, squared_gate, order)
        outputs, hits = shade_rays(inputs)
        if any(ctx.needs_input_grad):
            ctx.save_for_backward(*tensors)
            ctx.inputs, ctx.memory_bytes = inputs, settings.memory_bytes
        counts = torch.from_numpy(hits).long()
        ctx.mark_non_differentiable(counts)
        return torch.from_numpy(outputs), counts

    @staticmethod
    def backward(ctx: Any, table: Tensor, _: Tensor) -> tuple[Tensor | None, ...]:
        if torch.is_grad_enabled():
            raise RuntimeError(
                "trace: expected create_graph=False, got True; use backend='reference' to "
                "differentiate twice"
            )
        arrays = _unpack(ctx.saved_tensors)
        grads = gradients(
            ctx.inputs, arrays.cloud, arrays.motion, table.contiguous().numpy(), ctx.memory_bytes
        )
        to_rays = saturate_(torch.from_numpy(grads.rays))
        return (
            *(None, None, None),
            *(saturate_(torch.from_numpy(array)) for array in grads.cloud),
            _sh_gradient(arrays.sh, grads),
            *(saturate_(torch.from_numpy(array)) for array in grads.motion),
            to_rays[:, :3],
            to_rays[:, 3:6],
            to_rays[:, 6] if len(arrays.times) else None,
        )


def _unpack(tensors: tuple[Tensor, ...]) -> _Arrays:
    plain = [tensor.detach().contiguous() for tensor in tensors]
    numpy: list[np.ndarray] = [tensor.numpy() for tensor in plain]
    return _Arrays(
        cloud=Cloud(*numpy[:4]),
        sh=plain[4],
        motion=MotionArrays(*numpy[5:8]),
        origins=numpy[8],
        directions=numpy[9],
        times=numpy[10],
    )


def _inputs(
    arrays: _Arrays, settings: TraceSettings, squared_gate: float | None, order: Integers
) -> TraceInputs:
    rules = make_rules(settings, np.inf if squared_gate is None else squared_gate)
    scene = make_scene(
        arrays.cloud, arrays.motion, _color_table(arrays.sh), arrays.times, rules, order
    )
    return make_inputs(
        scene,
        (arrays.origins, arrays.directions, arrays.times),
        settings,
        rules,
        arrays.sh.shape[1],
    )


def _color_table(sh: Float[Tensor, "n k 3"]) -> Floats:
    """Plain colours, or sixteen coefficients of a channel side by side."""
    if sh.shape[1] == 1:
        return pad(_plain_colors(sh), (0, PLAIN_COLUMNS - 3)).flatten().numpy()
    return pad(sh.mT, (0, LANES - sh.shape[1])).flatten().numpy()


def _plain_colors(sh: Float[Tensor, "n 1 3"]) -> Float[Tensor, "n 3"]:
    return 0.5 + DEGREE_ZERO * sh[:, 0]


def _sh_gradient(sh: Float[Tensor, "n k 3"], grads: Gradients) -> Float[Tensor, "n k 3"]:
    if sh.shape[1] == 1:
        return (DEGREE_ZERO * torch.from_numpy(grads.plain_colors)).to(sh)[:, None]
    return torch.from_numpy(grads.lobes).view(-1, 3, LANES)[..., : sh.shape[1]].mT.contiguous()
