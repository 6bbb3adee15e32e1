"""Names of the networks that an ablation leaves out; loads nothing."""

from typing import Literal, get_args

Network = Literal[
    "depth",
    "motion",
    "object-mask",
    "image-classifier",
    "image-inpainting",
    "object-shadow",
    "text",
    "video",
    "ldrm",
    "deformation",
]
"""As on the command line, in the order of the table."""
NETWORKS: tuple[Network, ...] = get_args(Network)
