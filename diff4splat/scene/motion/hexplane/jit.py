"""The group of HexPlane kernels: products and sums may become fused operations."""

from pathlib import Path

from diff4splat.kernels.group import KernelGroup
from diff4splat.kernels.jit import CONTRACTED

GROUP = KernelGroup(
    "HexPlane fields",
    options=CONTRACTED,
    sources=(Path(__file__).parent,),
    warm_up="diff4splat.scene.motion.hexplane.warm_up",
    compile_s=2,
)
kernel = GROUP.kernel
