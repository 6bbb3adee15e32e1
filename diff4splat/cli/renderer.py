"""The renderer as commands see it: compiled before it is needed, and asked what it left out."""

from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from diff4splat.progress.phases import Phases
    from diff4splat.render.settings import RenderJob
    from diff4splat.scene.gaussians import Gaussians
    from diff4splat.scene.scene import Scene

COMPILED = "raster"
"""The back end that has something to compile."""


def prepare_renderer(gaussians: "Gaussians", phases: "Phases") -> None:
    """Before pictures of ``gaussians``: compile what will draw them, unless that is done."""
    from diff4splat.render.backends import BACKENDS, choose

    chosen = choose("auto", picture_job(gaussians))
    if chosen is import_module(BACKENDS[COMPILED]) and not is_compiled():
        compile_renderer(phases)


def is_compiled() -> bool:
    """Whether the compiled back end can draw at once."""
    from diff4splat.render.raster import warm

    return warm.is_ready()


def compile_renderer(phases: "Phases") -> tuple[str, ...]:
    """Load or compile every kernel with a progress bar; returns the names of the compiled ones."""
    from diff4splat.render.raster import warm

    return compile_ahead(warm, phases)


def compile_ahead(warm: ModuleType, phases: "Phases") -> tuple[str, ...]:
    """The same with any module that has ``kernel_count`` and ``warm``."""
    compiled = []
    with phases.phase("compile", warm.kernel_count()) as advance:

        def one_more(name: str) -> None:
            compiled.append(name)
            advance()

        warm.warm(one_more)
    return tuple(compiled)


def picture_job(gaussians: "Gaussians") -> "RenderJob":
    """A small picture of ``gaussians``: what back ends are asked whether they could draw."""
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


def left_out(scene: "Scene", time_s: float) -> str | None:
    """Which Gaussians no back end draws at ``time_s``, and why, in one line; None if it is none."""
    from diff4splat.render.support import usable_gaussians

    _, dropped = usable_gaussians(scene.state_at(time_s))
    if not dropped:
        return None
    parts = ", ".join(f"{count:,} with {name}" for name, count in dropped.items())
    return (
        f"{sum(dropped.values()):,} Gaussians left out of the first frame: "
        f"{parts} that are not finite or too large"
    )
