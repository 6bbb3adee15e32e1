"""The rasteriser's group of kernels: products and sums may become fused operations."""

from pathlib import Path

from diff4splat.kernels.group import KernelGroup
from diff4splat.kernels.jit import CONTRACTED

SOURCES = Path(__file__).parent

GROUP = KernelGroup(
    "the CPU renderer",
    options=CONTRACTED,
    sources=(SOURCES,),
    warm_up="diff4splat.render.raster.warm_up",
    compile_s=20,
)
kernel = GROUP.kernel
