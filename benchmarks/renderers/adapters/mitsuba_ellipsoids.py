"""Mitsuba 3 (BSD): its ellipsoids and radiance-field integrator, ray-traced on the CPU.

It evaluates a Gaussian at its peak along the ray, orders by where rays enter the 3-sigma shell, and
has no dilation of the image. Scales are widened here by what 0.3 px² means at the Gaussian's
depth, s'² = s² + 0.3 (z / f)², so that footprints are about ours; the image stays another one.
Quaternions are xyzw there. The search structure is built outside of what is timed.
"""

import importlib.util
from dataclasses import dataclass, fields
from typing import Any

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.geometry.camera import Camera
from diff4splat.geometry.rays import world_rays
from diff4splat.scene.gaussians import Gaussians

NAME = "mitsuba"
NOTE = "ray-traced: another order and footprint; search structure not timed; stops at light 0.01"
JUDGED = False
DILATION_PX2 = 0.3


def unavailable() -> str | None:
    """It needs Mitsuba, and a shared libLLVM that Mitsuba finds by itself."""
    if importlib.util.find_spec("mitsuba") is None:
        return "needs mitsuba; pip install mitsuba==3.7.1"
    return None


@dataclass(frozen=True, slots=True)
class Traced:
    """A loaded scene; ``parameters`` are Mitsuba's tables of the ellipsoids."""

    gaussians: Gaussians
    camera: Camera
    scene: Any
    parameters: Any
    integrator: Any
    rays: Any
    """One through the centre of every pixel."""

    def forward(self) -> Float[Tensor, "h w 3"]:
        """The image, row by row."""
        import drjit

        with drjit.suspend_grad():
            radiance = self._trace("Primal", None, None)[0]
        flat = torch.from_numpy(radiance.numpy().copy()).T
        return flat.unflatten(0, self.camera.size_px).contiguous()

    def forward_backward(self, grad_rgb: Float[Tensor, "h w 3"]) -> Gaussians:
        """Forward, then Mitsuba's replay of the paths for the gradient."""
        import drjit
        import mitsuba

        weight = mitsuba.Spectrum(grad_rgb.flatten(0, 1).T.contiguous().numpy())
        watched = [self.parameters[f"g.{name}"] for name in _TABLES]
        for table in watched:
            drjit.enable_grad(table)
        with drjit.suspend_grad():
            radiance = self._trace("Primal", None, None)[-1]
            drjit.eval(radiance)
            self._trace("Backward", weight, radiance)
        found = [torch.from_numpy(drjit.grad(table).numpy().copy()) for table in watched]
        for table in watched:
            drjit.disable_grad(table)
        return self._to_ours(found)

    def _trace(self, mode: str, weight: Any, state: Any) -> tuple[Any, ...]:
        import drjit
        import mitsuba

        sampler = mitsuba.load_dict({"type": "independent"})
        return self.integrator.sample(
            getattr(drjit.ADMode, mode), self.scene, sampler, self.rays, weight, state, True
        )

    def _to_ours(self, found: list[Tensor]) -> Gaussians:
        """Back through ``tables``: the widened scales and the order of the quaternions."""
        names = [field.name for field in fields(self.gaussians)]
        leaves = [getattr(self.gaussians, name).detach().requires_grad_() for name in names]
        made = tables(Gaussians(**dict(zip(names, leaves, strict=True))), self.camera)
        shaped = [grad.view_as(table) for grad, table in zip(found, made, strict=True)]
        back = torch.autograd.grad(made, leaves, shaped)
        return Gaussians(**dict(zip(names, back, strict=True)))


def prepare(gaussians: Gaussians, camera: Camera) -> Traced:
    """Load the ellipsoids and build Mitsuba's search structure."""
    import drjit
    import mitsuba

    mitsuba.set_variant("llvm_ad_rgb")
    drjit.set_thread_count(torch.get_num_threads())
    data, opacities, colors = tables(gaussians, camera)
    columns = {
        "centers": data[:, :3],
        "scales": data[:, 3:6],
        "quaternions": data[:, 6:],
        "opacities": opacities,
        "sh_coeffs": colors,
    }
    shape = {name: mitsuba.TensorXf(part.contiguous().numpy()) for name, part in columns.items()}
    scene = mitsuba.load_dict({"type": "scene", "g": {"type": "ellipsoids", **shape}})
    integrator = mitsuba.load_dict(
        {"type": "volprim_rf_basic", "max_depth": -1, "srgb_primitives": False}
    )
    origins, directions = (part.flatten(0, 1).T.contiguous().numpy() for part in world_rays(camera))
    rays = mitsuba.Ray3f(mitsuba.Point3f(origins), mitsuba.Vector3f(directions))
    return Traced(gaussians, camera, scene, mitsuba.traverse(scene), integrator, rays)


_TABLES = ("data", "opacities", "sh_coeffs")


def tables(
    gaussians: Gaussians, camera: Camera
) -> tuple[Float[Tensor, "n 10"], Float[Tensor, "n 1"], Float[Tensor, "n c"]]:
    """What Mitsuba keeps: (centre, scale, quaternion xyzw), opacity, harmonics; differentiable."""
    to_camera = camera.world_from_camera[:3, :3]
    depth = ((gaussians.means - camera.position) @ to_camera)[:, 2:]
    variance = gaussians.scales**2 + DILATION_PX2 * (depth / camera.focal_px[0]) ** 2
    quats = torch.nn.functional.normalize(gaussians.quats, dim=-1).roll(-1, -1)
    data = torch.cat([gaussians.means, variance.sqrt(), quats], 1)
    return data, gaussians.opacities[:, None], gaussians.sh.flatten(1)
