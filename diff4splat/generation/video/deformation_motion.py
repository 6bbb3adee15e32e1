"""Key-framed motion of canonical Gaussians by the deformation network.

Axes: ``k`` key times, ``m`` Gaussians that have a cell. The network is evaluated at one time per
call, so that memory does not grow with the number of key times times the grid.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.generation.video.canonical_scene import CanonicalScene
from diff4splat.models.deformation.keyframes import (
    DeformationUnits,
    deformation_state,
    keyframe_motion,
    raw_scales,
)
from diff4splat.models.protocols import DeformationMaps
from diff4splat.progress.run_log import RunLog
from diff4splat.scene.motion.protocol import Motion
from diff4splat.scene.motion.static import StaticMotion


def deform(
    network: DeformationMaps | None,
    canonical: CanonicalScene,
    key_times_s: Float[Tensor, " k"],
    units: DeformationUnits,
    log: RunLog,
) -> Motion:
    """Motion of the kept Gaussians; static without a network, or while it is the identity."""
    if network is None:
        return static_over(key_times_s)
    if network.is_identity():
        log.record_skipped(
            "deformation network",
            "its output layers are zero, so nothing can move",
            f"{len(key_times_s)} network calls and all key times",
        )
        return static_over(key_times_s)
    index = canonical.cell_index
    raw_scale = raw_scales(canonical.maps.gaussians[0].float())[index]
    fractions = torch.linspace(0, 1, len(key_times_s), device=key_times_s.device)
    states = []
    with log.phases.phase("deform", len(key_times_s)) as advance:
        for raw in network.at_times(canonical.maps.tokens, fractions[:, None]):
            states.append(deformation_state(raw[0].float(), raw_scale, index, units))
            advance()
    return keyframe_motion(states, key_times_s, torch.arange(len(index), device=index.device))


def static_over(key_times_s: Float[Tensor, " k"]) -> StaticMotion:
    """Nothing moves, for as long as the key times last."""
    return StaticMotion(time_range_s=(float(key_times_s[0]), float(key_times_s[-1])))
