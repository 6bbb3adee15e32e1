"""gsplat's CUDA kernels (Ye et al. 2025) behind the common API; the formulas are the reference's.

Axes: ``n`` Gaussians, ``k`` harmonics, ``c`` channels, ``h w`` pixels, ``b`` blended channels. One
pass makes all that is asked for.

The scene is moved so that the camera stands at the origin. R p + t would lose the digits that
camera and scene share, R (p - c) does not; the gradient of the position comes through the means.
What gsplat does otherwise, and nobody can set: a pixel takes no Gaussian that would leave it at
most 1e-4 of its light, nor anything behind. What light is left by then, at most
1e-4 / (1 - alpha_max), falls on the background.
"""

import sys
from contextlib import redirect_stdout
from dataclasses import replace
from functools import cache

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor
from torch.nn.functional import normalize

from diff4splat.geometry import quaternion
from diff4splat.geometry.camera import Camera
from diff4splat.render import reference
from diff4splat.render.channels import extra_channels, name_outputs
from diff4splat.render.gsplat import limits
from diff4splat.render.projection import camera_space, to_pixels
from diff4splat.render.settings import RenderJob, RenderOutput
from diff4splat.render.support import renderable_gaussians
from diff4splat.scene import harmonics


def unsupported_reason(job: RenderJob) -> str | None:
    """Why gsplat cannot do ``job``, or None; the first job that it might do loads the kernels."""
    with torch.autocast(job.gaussians.means.device.type, enabled=False):
        return (
            limits.tensor_limit(job)
            or limits.output_limit(job)
            or limits.setting_limit(job)
            or limits.gradient_limit(job)
            or loading_problem()
            or _version_limit(job)
            or limits.range_limit(job)
        )


def render(job: RenderJob) -> RenderOutput:
    """Make the images that ``job`` asks for."""
    with torch.autocast(job.gaussians.means.device.type, enabled=False):
        usable, dropped = renderable_gaussians(job.gaussians)
        if sum(dropped.values()) == len(usable):
            # gsplat divides by the number of Gaussians.
            return reference.render(job)
        blended, alpha = _blend(_select(job, usable) if dropped else job)
        return name_outputs(job, blended, 1 - alpha, None, dropped)


@cache
def loading_problem() -> str | None:
    """Why the kernels cannot be had, in one line; loading them may compile them."""
    try:
        # gsplat prints while it compiles, and standard output is the caller's.
        with redirect_stdout(sys.stderr):
            from gsplat.cuda._backend import _C
    except (ImportError, OSError, RuntimeError) as error:
        if isinstance(error, ModuleNotFoundError) and error.name == "gsplat":
            return "gsplat is not installed: pip install 'diff4splat[cuda]'"
        first_line, _, _ = str(error).partition("\n")
        return f"expected gsplat with CUDA kernels, got {first_line}"
    if _C is None:
        return "expected gsplat with CUDA kernels, got none; install a CUDA toolkit"
    return None


def version_constants() -> tuple[float, float]:
    """Largest alpha, and least compensation for the dilation, of the installed version."""
    try:
        from gsplat.cuda import _constants
    except ImportError:
        # Up to 1.5 they stand in the CUDA sources only.
        return 0.999, 0.0
    return _constants.MAX_ALPHA, _constants.MIN_COMPENSATION


def _version_limit(job: RenderJob) -> str | None:
    """What one version of the kernels holds constant."""
    import gsplat

    alpha_max, least_factor = version_constants()
    name, settings = f"gsplat {gsplat.__version__}", job.settings
    if settings.alpha_max != alpha_max:
        return f"expected alpha_max {alpha_max}, which {name} fixes, got {settings.alpha_max}"
    if settings.antialias and least_factor > 0:
        return f"expected no antialias, because {name} never dims below {least_factor}, got it"
    return None


def _select(job: RenderJob, keep: Bool[Tensor, " n"]) -> RenderJob:
    """``job`` for some of the Gaussians."""
    settings = job.settings
    if settings.features is not None:
        settings = replace(settings, features=settings.features[keep])
    return replace(
        job,
        gaussians=job.gaussians.select(keep),
        flow_gaussians=job.flow_gaussians.select(keep),
        settings=settings,
    )


def _blend(job: RenderJob) -> tuple[Float[Tensor, "h w b"], Float[Tensor, "h w"]]:
    """Blended channels in the order of ``name_outputs``, and alpha."""
    if job.outputs & {"flow", "features"}:
        return _rasterize(job, _channels(job), None, "RGB")
    # gsplat's own harmonics and depth are kernels that skip what is not seen.
    if "rgb" in job.outputs:
        mode = "RGB+D" if "depth" in job.outputs else "RGB"
        blended, alpha = _rasterize(job, job.gaussians.sh, job.gaussians.degree, mode)
    else:
        # gsplat 1.5 wants colours even where it draws none.
        blended, alpha = _rasterize(job, job.gaussians.means, None, "D")
    return torch.cat([blended, alpha[..., None]], -1), alpha


def _rasterize(
    job: RenderJob, colors: Float[Tensor, "n *k c"], degree: int | None, mode: str
) -> tuple[Float[Tensor, "h w b"], Float[Tensor, "h w"]]:
    """Blended ``colors``, which are harmonics of ``degree`` if there is one, and alpha."""
    import gsplat

    gaussians, camera, settings = job.gaussians, job.camera, job.settings
    blended, alpha, _ = gsplat.rasterization(
        means=gaussians.means - camera.position,
        # gsplat makes NaN of a zero quaternion.
        quats=quaternion.normalize(gaussians.quats),
        scales=gaussians.scales,
        opacities=gaussians.opacities,
        colors=colors,
        viewmats=_view_matrix(camera)[None],
        Ks=_intrinsic_matrix(camera)[None],
        width=camera.size_px[1],
        height=camera.size_px[0],
        # gsplat draws what lies exactly on the near plane.
        near_plane=float(np.nextafter(np.float32(settings.near_depth), np.float32(np.inf))),
        far_plane=float(np.finfo(np.float32).max),
        radius_clip=0.0,
        eps2d=settings.added_px2,
        sh_degree=degree,
        packed=False,
        render_mode=mode,
        rasterize_mode="antialiased" if settings.antialias else "classic",
    )
    return blended[0], alpha[0, ..., 0]


def _view_matrix(camera: Camera) -> Float[Tensor, "4 4"]:
    """``camera_from_world`` of a camera at the origin."""
    rotation = camera.world_from_camera[:3, :3].mT
    return torch.block_diag(rotation, rotation.new_ones(1, 1))


def _intrinsic_matrix(camera: Camera) -> Float[Tensor, "3 3"]:
    """[f_x 0 c_x; 0 f_y c_y; 0 0 1]."""
    upper = torch.cat([camera.focal_px.diag(), camera.center_px[:, None]], 1)
    return torch.cat([upper, upper.new_tensor([[0.0, 0.0, 1.0]])])


def _channels(job: RenderJob) -> Float[Tensor, "n c"]:
    """Every channel as a number per Gaussian."""
    means, settings = job.gaussians.means, job.settings
    local = camera_space(job.camera, means)
    # What is not drawn shall not divide by its z.
    local = torch.where(local[:, 2:] > settings.near_depth, local, 1.0)
    center_px = to_pixels(job.camera, local)
    extras = extra_channels(
        job, local[:, 2], center_px, job.flow_gaussians.means, settings.features
    )
    if "rgb" not in job.outputs:
        return extras
    directions = normalize(means - job.camera.position, dim=-1)
    return torch.cat([harmonics.color(job.gaussians.sh, directions), extras], 1)
