"""Mitsuba 3 (BSD): ``ellipsoids`` and ``volprim_rf_basic`` through LLVM, on rays that we give it.

The search structure is built in ``load``; ``forward`` and ``forward_backward`` only look.
"""

from dataclasses import dataclass
from typing import Any

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.render.trace.rays import Rays
from diff4splat.scene.gaussians import Gaussians

TABLES = ("g.data", "g.opacities", "g.sh_coeffs")


@dataclass(frozen=True, slots=True, kw_only=True)
class Loaded:
    """A scene with its search structure, and what looks at it."""

    scene: Any
    parameters: Any
    integrator: Any
    sampler: Any


def start(threads: int) -> None:
    """Choose the variant and the number of threads."""
    import drjit
    import mitsuba

    mitsuba.set_variant("llvm_ad_rgb")
    drjit.set_thread_count(threads)


def to_rays(rays: Rays) -> Any:
    """The same rays as Mitsuba keeps them."""
    import mitsuba

    origins, directions = rays.origins.T.contiguous(), rays.directions.T.contiguous()
    return mitsuba.Ray3f(mitsuba.Point3f(origins.numpy()), mitsuba.Vector3f(directions.numpy()))


def load(gaussians: Gaussians) -> Loaded:
    """Copy the tables, quaternions as xyzw, and build."""
    import drjit
    import mitsuba

    columns = {
        "centers": gaussians.means,
        "scales": gaussians.scales,
        "quaternions": torch.nn.functional.normalize(gaussians.quats, dim=-1).roll(-1, -1),
        "opacities": gaussians.opacities[:, None],
        "sh_coeffs": gaussians.sh.flatten(1),
    }
    shape = {name: mitsuba.TensorXf(part.contiguous().numpy()) for name, part in columns.items()}
    scene = mitsuba.load_dict({"type": "scene", "g": {"type": "ellipsoids", **shape}})
    drjit.sync_thread()
    rules = {"type": "volprim_rf_basic", "max_depth": -1, "srgb_primitives": False}
    return Loaded(
        scene=scene,
        parameters=mitsuba.traverse(scene),
        integrator=mitsuba.load_dict(rules),
        sampler=mitsuba.load_dict({"type": "independent"}),
    )


def forward(loaded: Loaded, rays: Any) -> Float[Tensor, "r 3"]:
    """What every ray sees."""
    import drjit

    with drjit.suspend_grad():
        radiance = _sample(loaded, "Primal", rays, None, None)[0]
    return torch.from_numpy(radiance.numpy().copy()).T


def forward_backward(loaded: Loaded, rays: Any, weight: Float[Tensor, "r 3"]) -> list[Tensor]:
    """Gradients of Σ weight · colour in Mitsuba's tables, by its replay of the paths."""
    import drjit
    import mitsuba

    watched = [loaded.parameters[name] for name in TABLES]
    for table in watched:
        drjit.enable_grad(table)
    with drjit.suspend_grad():
        radiance = _sample(loaded, "Primal", rays, None, None)[-1]
        drjit.eval(radiance)
        _sample(loaded, "Backward", rays, mitsuba.Spectrum(weight.T.contiguous().numpy()), radiance)
    found = [torch.from_numpy(drjit.grad(table).numpy().copy()) for table in watched]
    for table in watched:
        drjit.disable_grad(table)
    return found


def _sample(loaded: Loaded, mode: str, rays: Any, weight: Any, state: Any) -> tuple[Any, ...]:
    import drjit

    chosen = getattr(drjit.ADMode, mode)
    return loaded.integrator.sample(chosen, loaded.scene, loaded.sampler, rays, weight, state, True)
