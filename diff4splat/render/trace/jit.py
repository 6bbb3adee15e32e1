"""The ray tracer's group of kernels: without fused operations.

The backward pass thus takes the same decisions as the forward pass.
"""

from pathlib import Path

from diff4splat.kernels.group import KernelGroup
from diff4splat.kernels.jit import EXACT
from diff4splat.render.raster.jit import SOURCES

GROUP = KernelGroup(
    "the ray tracer",
    options=EXACT,
    sources=(Path(__file__).parent, SOURCES),
    warm_up="diff4splat.render.trace.warm_up",
    compile_s=40,
)
kernel = GROUP.kernel
