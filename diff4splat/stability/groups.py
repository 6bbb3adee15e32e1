"""The groups of checks and what each is about; imports no torch."""

from collections.abc import Sequence

from diff4splat.errors import ConfigError
from diff4splat.paths.messages import unknown_name

GROUPS = {
    "samplers": "Exact velocity fields of data of deviation σ, under ever stronger guidance, "
    "on the levels that generation chooses. Crossed-out cells are not usable: the median end point "
    "is off by more than 5 %, or more than 5 % of the trajectories end more than 30 % away.",
    "networks": "Every trained network in float32, bfloat16 and float16 against itself in float64, "
    "with gradients of all weights and inputs.",
    "sampling": "The trained networks under guidance of 1 to 30 at 1 to 16 steps: the sampled "
    "latents in float32 against float64.",
    "end-to-end": "One image and prompt to a scene, with all networks in one precision. The "
    "error is that of a view beside the input view.",
    "long-videos": "A thousand frames from the decoder, latent frame by latent frame, against one "
    "pass in float64.",
    "images": "Inputs that are no photographs. Thumbnails: input, first view, a view from the "
    "side.",
    "cameras": "Lenses and places of the camera that no photographer chooses.",
    "depth": "Depth of two encoders, fused and shrunk: maps that agree, contradict each other, are "
    "flat or extreme.",
    "motion": "Nothing moves, everything moves, and rotations by half a turn.",
    "gaussians": "Degenerate Gaussians, rasterised and ray traced.",
    "losses": "Training losses of degenerate depth maps.",
    "fits": "A few steps of per-scene fits on tiny captures: positions in float32 against float64, "
    "and whole fits in float32 against fits in float64.",
    "onnx": "ONNX Runtime against PyTorch, both in float32, on ordinary and extreme inputs.",
    "thresholds": "How many Gaussians change sides when a threshold or the image changes a little.",
}
"""Name → what its checks are, in the order of the report."""


def require_groups(names: Sequence[str]) -> None:
    """Refuse names of no group.

    Raises:
        ConfigError: with the names that there are.
    """
    for name in names:
        if name not in GROUPS:
            raise ConfigError(unknown_name("--only", name, GROUPS))
