"""The group of kernels that draw worlds, with equal bits on every machine.

Nothing is fused or reordered, and no function of a mathematics library is called.
"""

from pathlib import Path

from diff4splat.kernels.group import KernelGroup
from diff4splat.kernels.jit import EXACT

GROUP = KernelGroup(
    "the renderer of worlds",
    options=EXACT,
    sources=(Path(__file__).parent,),
    warm_up="diff4splat.data_prep.synthetic.renderer.warm_up",
    compile_s=20,
)
kernel = GROUP.kernel
