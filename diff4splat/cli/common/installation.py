"""Checks of the installation: packages, libraries, back ends, and a test render."""

import re
from importlib import import_module, metadata
from typing import TYPE_CHECKING

from diff4splat.errors import Diff4SplatError

if TYPE_CHECKING:
    from diff4splat.scene.gaussians import Gaussians

LIBRARIES = (
    "diff4splat.generation.pipeline",
    "diff4splat.outputs.scene_folder",
    "diff4splat.render.raster.warm_up",
    "diff4splat.render.trace.warm_up",
)
"""Modules whose import loads every library that commands need."""
TOLERANCE = 1e-4
"""Largest RGB error against the reference back end in float64."""


def require_packages() -> None:
    """Require every package that diff4splat depends on.

    Raises:
        Diff4SplatError: with the missing packages.
    """
    if version("diff4splat") is None:
        raise Diff4SplatError(
            "installation: expected diff4splat to be installed, got a bare folder; pip install -e ."
        )
    needed = [line for line in metadata.requires("diff4splat") or [] if "extra ==" not in line]
    missing = [line for line in needed if version(re.split(r"[^\w.-]", line)[0]) is None]
    if missing:
        lines = " ".join(f"'{line}'" for line in missing)
        raise Diff4SplatError(
            f"installation: expected {', '.join(missing)}, got none; pip install {lines}"
        )


def version(package: str) -> str | None:
    """Version of an installed package, or None."""
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return None


def load_libraries() -> None:
    """Import every library that commands need.

    Raises:
        Diff4SplatError: a library is installed but cannot be loaded.
    """
    try:
        for module in LIBRARIES:
            import_module(module)
    except (ImportError, OSError) as error:
        raise Diff4SplatError(
            f"installation: expected every library to load, got {error}; install it again"
        ) from error


def unsupported_reason(backend: str, device: str) -> str | None:
    """Why a back end does not draw float32 on a device."""
    from diff4splat.cli.common.precompile import small_job
    from diff4splat.render.backends import BACKENDS

    return import_module(BACKENDS[backend]).unsupported_reason(small_job(single_gaussian(device)))


def backend_readiness(backend: str) -> str:
    """Whether a back end can render at once."""
    from diff4splat.cli.common.precompile import RASTER, RASTERIZER, readiness

    return readiness(RASTERIZER) if backend == RASTER else "ready"


def tracer_readiness() -> str:
    """Whether rays can be traced at once, or at all."""
    from diff4splat.cli.common.precompile import TRACER, readiness
    from diff4splat.render.trace.support import unsupported_reason as tracer_reason

    if (reason := tracer_reason(single_gaussian("cpu"))) is not None:
        return f"refuses: {reason}"
    return readiness(TRACER)


def self_test() -> str:
    """Render with the compiled back end if it is ready, else with the reference.

    Raises:
        Diff4SplatError: the image differs from the float64 reference.
    """
    import torch

    from diff4splat.cli.common.precompile import RASTER, RASTERIZER, kernel_group, small_job
    from diff4splat.render.api import render

    ready = unsupported_reason(RASTER, "cpu") is None and kernel_group(RASTERIZER).is_ready()
    backend = RASTER if ready else "reference"
    scene = single_gaussian("cpu")
    camera = small_job(scene).camera
    rgb = render(scene, camera, backend=backend).rgb
    exact = render(scene.to(torch.float64), camera, backend="reference").rgb
    error = float((rgb - exact).abs().max())
    if not error < TOLERANCE or not bool(exact.any()):
        raise Diff4SplatError(
            f"renderer {backend}: expected the image of float64 within {TOLERANCE:g}, "
            f"got {error:g} off; install numba and torch again"
        )
    return f"renderer {backend} agrees with float64 to {error:.0e}"


def single_gaussian(device: str) -> "Gaussians":
    """One Gaussian in front of the camera, for test renders."""
    import torch

    from diff4splat.scene.gaussians import Gaussians

    return Gaussians(
        means=torch.tensor([[0.1, 0.0, 1.0]]),
        quats=torch.tensor([[1.0, 0.2, 0.0, 0.0]]),
        scales=torch.tensor([[0.2, 0.1, 0.1]]),
        opacities=torch.tensor([0.8]),
        sh=torch.tensor([[[0.5, 0.2, -0.3]]]),
    ).to(torch.device(device))
