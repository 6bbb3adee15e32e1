"""Ray tracing of static or moving Gaussians: compiled where possible, else by brute force.

Axes: ``r`` rays, ``n`` Gaussians.
"""

from collections.abc import Collection
from dataclasses import fields
from functools import partial

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from diff4splat.errors import ConfigError, InputError, ShapeError
from diff4splat.render.settings import require_outputs
from diff4splat.render.trace import reference
from diff4splat.render.trace.bvh.bvh import Bvh
from diff4splat.render.trace.moving import MovingCloud
from diff4splat.render.trace.rays import Rays
from diff4splat.render.trace.reference import RayOutputs
from diff4splat.render.trace.settings import OUTPUTS, TraceOutput, TraceSettings
from diff4splat.render.trace.support import unsupported_reason, valid_gaussians
from diff4splat.scene.gaussians import Gaussians

DEFAULTS = TraceSettings()
BACKENDS = ("auto", "compiled", "reference")


def trace(
    gaussians: Gaussians,
    rays: Rays,
    *,
    outputs: Collection[str] = ("rgb",),
    settings: TraceSettings = DEFAULTS,
    moving: MovingCloud | None = None,
    backend: str = "auto",
    bvh: Bvh | None = None,
) -> TraceOutput:
    """Colour, distance, alpha or hits along ``rays``; all inputs and the background get gradients.

    ``moving`` moves each Gaussian to the time of the ray that hits it. ``backend`` "compiled" is
    for float32 on a CPU, "reference" for everything, "auto" the first that supports the inputs.
    A ``bvh`` from `build_bvh` saves time and changes no result, whatever has moved since.

    Raises:
        ConfigError: an unknown output or back end, one that does not support the inputs, or the
            ``bvh`` of a scene with another number of Gaussians.
        ShapeError: dtypes or devices differ, half precision, or another number of velocities.
        InputError: Gaussians that move, and rays without times.
    """
    wanted = require_outputs(outputs, OUTPUTS)
    _require_uniform(gaussians, rays, moving)
    tracer = _backend(backend, gaussians)
    valid, dropped = valid_gaussians(gaussians, moving)
    if bvh is not None:
        order = bvh.select(valid)
        # Brute force tries every Gaussian and needs no order.
        if tracer is not reference.trace_reference:
            tracer = partial(tracer, order=order)
    if dropped:
        index = valid.nonzero().squeeze(1)
        gaussians = gaussians.select(index)
        moving = None if moving is None else moving.select(index)
    valid_rays = rays if rays.valid is None else rays.select(rays.valid.nonzero().squeeze(1))
    with torch.autocast(rays.origins.device.type, enabled=False):
        traced = tracer(gaussians, valid_rays, settings, moving)
        outputs = _named(wanted, traced, settings)
        if rays.valid is not None:
            outputs = {name: _scattered(value, rays.valid) for name, value in outputs.items()}
    return TraceOutput(
        **outputs, dropped_nonfinite=sum(dropped.values()), dropped_by_parameter=dropped
    )


def _backend(name: str, gaussians: Gaussians):
    """The function that traces.

    Raises:
        ConfigError: the name is unknown, or the compiled tracer does not support the Gaussians.
    """
    if name not in BACKENDS:
        raise ConfigError(f"backend: expected one of {', '.join(BACKENDS)}, got {name!r}")
    reason = unsupported_reason(gaussians) if name != "reference" else "not asked for"
    if name == "compiled" and reason is not None:
        raise ConfigError(f"backend 'compiled': {reason}; use backend='auto'")
    if reason is not None:
        return reference.trace_reference
    # Numba is loaded with the first rays, not with the library.
    from diff4splat.render.trace.function import trace_compiled
    from diff4splat.render.trace.jit import GROUP

    GROUP.ensure_compiled()
    return trace_compiled


def _require_uniform(gaussians: Gaussians, rays: Rays, moving: MovingCloud | None) -> None:
    """One arithmetic fits everything, and what moves is seen at some time.

    Raises:
        ShapeError: it does not.
        InputError: rays have no times.
    """
    tensors = [rays.origins, *(getattr(gaussians, f.name) for f in fields(gaussians))]
    if moving is not None:
        tensors += [moving.velocities, moving.time_centers_s, moving.time_deviations_s]
        if len(moving) != len(gaussians):
            raise ShapeError(
                f"moving: expected as many as Gaussians, {len(gaussians)}, got {len(moving)}"
            )
        if rays.time_s is None:
            raise InputError("rays: expected time_s, because Gaussians move, got None")
    kinds = {(tensor.dtype, tensor.device) for tensor in tensors}
    if len(kinds) != 1 or tensors[0].dtype not in (torch.float32, torch.float64):
        got = ", ".join(sorted(f"{dtype} on {device}" for dtype, device in kinds))
        raise ShapeError(
            f"trace: expected one dtype, float32 or float64, on one device, got {got}; call .to()"
        )


def _named(
    wanted: frozenset[str], traced: RayOutputs, settings: TraceSettings
) -> dict[str, Float[Tensor, "r ..."] | Int[Tensor, " r"]]:
    """The requested outputs."""
    outputs = {"median_distance": traced.median, "alpha": traced.weight, "hits": traced.hits}
    if "rgb" in wanted:
        outputs["rgb"] = traced.rgb + traced.light[:, None] * _background(settings, traced.light)
    if "distance" in wanted:
        weight = torch.where(traced.weight > 0, traced.weight, 1.0)
        outputs["distance"] = traced.distance_sum / weight
    return {name: outputs[name] for name in wanted}


def _background(settings: TraceSettings, like: Float[Tensor, " r"]) -> Float[Tensor, "3"]:
    if isinstance(settings.background, Tensor):
        return settings.background.to(like)
    return like.new_tensor(settings.background)


def _scattered(
    values: Float[Tensor, "m ..."] | Int[Tensor, " m"], valid: Bool[Tensor, " r"]
) -> Float[Tensor, "r ..."] | Int[Tensor, " r"]:
    """Outputs in the rows of the valid rays, 0 in the others."""
    rows = values.new_zeros(len(valid), *values.shape[1:])
    return rows.index_copy(0, valid.nonzero().squeeze(1), values)
