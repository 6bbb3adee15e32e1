"""From video latents to canonical Gaussians and their motion.

Axes: ``t h w`` Gaussian grid, ``n`` its cells in that order, ``m`` those kept after pruning, ``k``
key times. The deformation network answers one time per call, so that memory does not grow with the
number of key times times the grid.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import torch
from jaxtyping import Float, Int
from torch import Tensor

from diff4splat.errors import ConfigError
from diff4splat.generation.keyframe_gaussians import canonical_gaussians
from diff4splat.models.config.model import ActivationConfig
from diff4splat.models.deformation.keyframes import (
    DeformationState,
    DeformationUnits,
    deformation_state,
    keyframe_motion,
    raw_scales,
)
from diff4splat.models.deformation.network import DeformationNetwork
from diff4splat.models.deformation.refined_network import RefinedDeformation
from diff4splat.models.ldrm.gaussian_head import PixelBase, activate
from diff4splat.models.ldrm.raw_maps import RawGaussianMaps
from diff4splat.models.ldrm.refinement.posed_video import PosedVideo
from diff4splat.progress.run_log import RunLog
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.protocol import Motion
from diff4splat.scene.motion.static import StaticMotion

RENDER_CUTOFF = 1 / 255
"""Renderers draw nothing below this opacity, so dropping it changes no pixel."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Canonical:
    """Gaussians with what their deformation needs."""

    gaussians: Gaussians
    cells: Int[Tensor, " m"]
    """Where each lies in the grid; Gaussians behind the first m lie in none."""
    maps: RawGaussianMaps
    backing: Int[Tensor, " b"] | None = None
    """The cell with which each of the next b goes, if that is told to go; all others stand."""

    @property
    def is_picture(self) -> bool:
        """One picture as it is; only that has a backing."""
        return self.backing is not None and len(self.backing) > 0

    @property
    def told_cells(self) -> Int[Tensor, " mb"]:
        """Whose motion the first m + b Gaussians are told."""
        return self.cells if self.backing is None else torch.cat([self.cells, self.backing])

    @property
    def every_cell(self) -> Int[Tensor, " n"]:
        """The cell of every Gaussian; those without one get the number after the last."""
        grid, told = self.maps.gaussians[0, 0].numel(), self.told_cells
        return torch.cat([told, told.new_full((len(self.gaussians) - len(told),), grid)])


def reconstruct(maps: RawGaussianMaps, base: PixelBase, config: ActivationConfig) -> Canonical:
    """One Gaussian for every cell of the grid."""
    gaussians = activate(maps.gaussians[0].float(), base, config)
    cells = torch.arange(len(gaussians), device=gaussians.means.device)
    return Canonical(gaussians=gaussians, cells=cells, maps=maps)


def reconstruct_detailed(
    maps: RawGaussianMaps, sight: PosedVideo, config: ActivationConfig, log: RunLog
) -> Canonical:
    """Gaussians of key frames and surroundings; pixels that earlier frames show are left out."""
    found = canonical_gaussians(maps, sight, config)
    if found.doubled:
        why, saved = "an earlier key frame shows the same points", f"{found.doubled:,} Gaussians"
        log.record_skipped("doubled pixels", why, saved)
    return Canonical(gaussians=found.gaussians, cells=found.cells, maps=maps, backing=found.backing)


def prune_cells(canonical: Canonical, min_opacity: float, log: RunLog) -> Canonical:
    """Keep Gaussians of at least ``min_opacity`` (Diff4Splat: 0.005), and say what that dropped."""
    opacities = canonical.gaussians.opacities
    kept, own = opacities >= min_opacity, len(canonical.cells)
    dropped = len(kept) - int(kept.sum())
    if dropped == len(kept):
        raise ConfigError(
            f"--min-opacity: expected a value that leaves some Gaussians, got {min_opacity:g}; "
            "lower it"
        )
    if dropped:
        faintest = float(opacities[~kept].max())
        log.record_skipped(
            "faint Gaussians",
            f"opacity below {min_opacity:g}",
            f"{dropped:,} of {len(kept):,} Gaussians",
            faintest if faintest >= RENDER_CUTOFF else 0.0,
        )
    behind = canonical.backing
    return Canonical(
        gaussians=canonical.gaussians.select(kept),
        cells=canonical.cells[kept[:own]],
        maps=canonical.maps,
        backing=behind if behind is None else behind[kept[own : own + len(behind)]],
    )


def _moved_on(
    state: DeformationState,
    told: Float[Tensor, "t h w 3"],
    canonical: Canonical,
    fraction: float,
) -> DeformationState:
    """The state with the told offsets at a fraction of the clip."""
    place = fraction * (len(told) - 1)
    before = min(int(place), len(told) - 2)
    now = torch.lerp(told[before], told[before + 1], place - before).flatten(0, 1)
    cells = canonical.told_cells[: len(state.offsets)]
    own = cells < len(now)
    more = now[cells[own]]
    return replace(state, offsets=state.offsets.index_add(0, own.nonzero()[:, 0], more))


def motion_from_offsets(
    canonical: Canonical, key_times_s: Float[Tensor, " k"], told: Float[Tensor, "t h w 3"]
) -> Motion:
    """Key-framed motion of the kept Gaussians by nothing but ``told`` offsets."""
    fractions = torch.linspace(0, 1, len(key_times_s)).tolist()
    states = states_from_offsets(canonical, told, fractions)
    every = torch.arange(len(canonical.told_cells), device=told.device)
    return keyframe_motion(states, key_times_s, every)


def states_from_offsets(
    canonical: Canonical, told: Float[Tensor, "t h w 3"], fractions: Sequence[float]
) -> list[DeformationState]:
    """How the kept Gaussians differ at fractions of the clip, by nothing but ``told`` offsets."""
    count = len(canonical.told_cells)
    still = DeformationState(
        offsets=told.new_zeros(count, 3),
        rotations=told.new_tensor([1.0, 0.0, 0.0, 0.0]).repeat(count, 1),
        log_scale_offsets=told.new_zeros(count, 3),
    )
    return [_moved_on(still, told, canonical, fraction) for fraction in fractions]


def deform(
    network: DeformationNetwork | RefinedDeformation,
    canonical: Canonical,
    key_times_s: Float[Tensor, " k"],
    units: DeformationUnits,
    log: RunLog,
    told: Float[Tensor, "t h w 3"] | None = None,
) -> Motion:
    """Key-framed motion of the kept Gaussians, or none when the network is still the identity.

    ``told`` offsets of the first frame's cells, evenly spread in time, are added to its answers.
    """
    start_s, stop_s = float(key_times_s[0]), float(key_times_s[-1])
    if network.is_identity and told is None:
        log.record_skipped(
            "deformation network",
            "its output layers are zero, so nothing can move",
            f"{len(key_times_s)} network calls and all key times",
        )
        return StaticMotion(time_range_s=(start_s, stop_s))
    raw_scale = raw_scales(canonical.maps.gaussians[0].float())[canonical.cells]
    fractions = torch.linspace(0, 1, len(key_times_s), device=key_times_s.device)
    states = []
    with log.phases.phase("deform", len(key_times_s)) as advance:
        for raw in network.at_times(canonical.maps.tokens, fractions[:, None]):
            state = deformation_state(raw[0].float(), raw_scale, canonical.cells, units)
            fraction = float(fractions[len(states)])
            states.append(state if told is None else _moved_on(state, told, canonical, fraction))
            advance()
    everything = torch.arange(len(canonical.cells), device=raw_scale.device)
    return keyframe_motion(states, key_times_s, everything)
