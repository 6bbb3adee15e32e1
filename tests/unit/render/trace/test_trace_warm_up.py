"""Precompilation reaches every kernel of the ray tracer."""

from diff4splat.render.raster.jit import GROUP as RASTER
from diff4splat.render.trace.jit import GROUP


def test_precompilation_reaches_every_kernel() -> None:
    GROUP.ensure_compiled()
    compiled: list[str] = []
    assert GROUP.precompile(compiled.append) >= 0
    assert GROUP.is_ready()
    assert GROUP.kernel_count() == len(GROUP.kernels) > 10
    assert all(kernel.signatures for kernel in GROUP.kernels)
    # They were compiled before, so none is reported again.
    assert not compiled


def test_kernels_are_separate_from_those_of_the_rasteriser() -> None:
    assert not any(kernel in RASTER.kernels for kernel in GROUP.kernels)
