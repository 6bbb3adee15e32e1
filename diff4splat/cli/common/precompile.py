"""Kernels as commands see them: by name, and compiled before they are needed."""

from collections.abc import Iterable
from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from diff4splat.evaluation.protocols.protocol import SourceRange
    from diff4splat.kernels.group import KernelGroup
    from diff4splat.progress.phases import Phases
    from diff4splat.render.settings import RenderJob
    from diff4splat.scene.gaussians import Gaussians
    from diff4splat.training.recipe.data import SourceSettings

RASTER = "raster"
"""The back end that has kernels."""
WORLDS, HEXPLANE = "worlds", "hexplane fields"
RASTERIZER, TRACER = f"renderer {RASTER}", "renderer trace"
GROUPS = {
    WORLDS: "diff4splat.data_prep.synthetic.renderer.jit",
    HEXPLANE: "diff4splat.scene.motion.hexplane.jit",
    RASTERIZER: "diff4splat.render.raster.jit",
    TRACER: "diff4splat.render.trace.jit",
}
"""Modules with a ``GROUP`` of kernels, by the name of the group in ``diff4splat doctor``."""


def kernel_group(name: str) -> "KernelGroup":
    """The group of that name in ``GROUPS``; imports Numba."""
    return import_module(GROUPS[name]).GROUP


def readiness(name: str) -> str:
    """Whether the kernels of a group can be called at once, in words."""
    group = kernel_group(name)
    if group.is_ready():
        return "ready"
    return f"will compile on first use (about {group.compile_s} s); now: diff4splat doctor --warm"


def precompile_renderer(gaussians: "Gaussians", phases: "Phases") -> None:
    """Before ``gaussians`` are rendered: compile the rasteriser if it will be chosen."""
    from diff4splat.progress.precompile import ensure_precompiled
    from diff4splat.render.backends import BACKENDS, choose

    if choose("auto", small_job(gaussians)) is import_module(BACKENDS[RASTER]):
        ensure_precompiled(kernel_group(RASTERIZER), phases)


def precompile_tracer(phases: "Phases") -> None:
    """Before rays are traced: compile the ray tracer."""
    from diff4splat.progress.precompile import ensure_precompiled

    ensure_precompiled(kernel_group(TRACER), phases)


def precompile_sources(sources: "Iterable[SourceSettings | SourceRange]", phases: "Phases") -> None:
    """Before clips come from ``sources``: compile the renderer of worlds if one source needs it."""
    from diff4splat.progress.precompile import ensure_precompiled

    if any(source.kind == "worlds" for source in sources):
        ensure_precompiled(kernel_group(WORLDS), phases)


def small_job(gaussians: "Gaussians") -> "RenderJob":
    """A small image of ``gaussians``: the job that back ends are asked whether they support."""
    from diff4splat.geometry.camera import pinhole
    from diff4splat.render.settings import RenderJob, RenderSettings

    means = gaussians.means
    camera = pinhole(16.0, (16, 16)).to(means.dtype).to(means.device)
    return RenderJob(
        gaussians=gaussians,
        camera=camera,
        outputs=frozenset({"rgb"}),
        settings=RenderSettings(),
        flow_gaussians=gaussians,
        flow_camera=camera,
    )
