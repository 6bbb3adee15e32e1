"""A folder of numbered PLY files: key frames where row i is the same Gaussian in every file.

Axes: ``t`` files, ``n`` Gaussians, ``m`` moving ones. Names end in a number, as in
``frame_0007.ply`` or ``12.compressed.ply``; times are those that our own files name, or the number
of the file over ``fps``.
"""

import itertools
import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.errors import FileFormatError
from diff4splat.geometry import quaternion
from diff4splat.io.ply.ply_file import read_ply_content
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.flip_book import flip_book
from diff4splat.scene.motion.keyframes import KeyframeMotion
from diff4splat.scene.motion.protocol import Motion

NUMBERED = re.compile(r"(.*?)([0-9]{1,9})(?:\.compressed)?\.ply", re.IGNORECASE)
MAX_FILES, MAX_GAUSSIANS = 10_000, 60_000_000
"""Of Gaussians in all files together, 2.4 GB as key frames."""
SAME_LOOK = 0.02
"""Largest change of an opacity or colour between two states of one Gaussian."""
LONGEST_STEP = 0.1
"""Largest median step from file to file, as a share of the scene's radius: rows in another order
would be farther apart."""


def numbered_files(folder: Path) -> list[Path]:
    """The numbered PLY files of a folder by number; of several sets the largest.

    Raises:
        FileFormatError: there are too many.
    """
    sets: dict[str, dict[int, Path]] = {}
    for file in sorted(folder.iterdir()):
        if match := NUMBERED.fullmatch(file.name):
            sets.setdefault(match[1], {})[int(match[2])] = file
    best = max(sets.values(), key=len, default={})
    if len(best) > MAX_FILES:
        raise FileFormatError(f"{folder}: expected at most {MAX_FILES:,} files, got {len(best):,}")
    return [best[number] for number in sorted(best)]


def read_ply_sequence(
    files: Sequence[Path], fps: float, advance: Callable[[], None] = lambda: None
) -> tuple[Gaussians, Motion, str]:
    """Gaussians, their motion, and one line on how the files were joined.

    Raises:
        FileFormatError: a file is no PLY of Gaussians, or all together are too large.
    """
    states, stored_s = [], []
    for file in files:
        content = read_ply_content(file)
        states.append(content.gaussians)
        stored_s.append(content.time_s)
        if sum(map(len, states)) > MAX_GAUSSIANS:
            raise FileFormatError(
                f"{file}: expected at most {MAX_GAUSSIANS:,} Gaussians in all files, got more; "
                "convert fewer files"
            )
        advance()
    times_s = _times_s(stored_s, fps)
    if not (reason := _why_not_keyed(states)):
        gaussians, motion = _keyed(states, times_s)
        moving = len(motion.moving_index)
        return gaussians, motion, f"{len(files)} files became key times, {moving:,} Gaussians move"
    least = min(state.sh.shape[1] for state in states)
    states = [replace(state, sh=state.sh[:, :least]) for state in states]
    gaussians, motion = flip_book(states, times_s)
    return gaussians, motion, f"{len(files)} files are kept one by one: {reason}"


def _times_s(stored_s: Sequence[float | None], fps: float) -> list[float]:
    known = [time_s for time_s in stored_s if time_s is not None]
    increase = all(a < b for a, b in itertools.pairwise(known))
    if len(known) == len(stored_s) and increase:
        return known
    return [index / fps for index in range(len(stored_s))]


def _why_not_keyed(states: Sequence[Gaussians]) -> str:
    """Why row i is not the same Gaussian in every file; empty if it is."""
    first = states[0]
    if any(s.sh.shape != first.sh.shape for s in states):
        return "their numbers of Gaussians differ"
    radius = _median((first.means - first.means.median(0).values).norm(dim=-1)) or 1.0
    for before, state in itertools.pairwise(states):
        look = max(_largest(state.opacities - first.opacities), _largest(state.sh - first.sh))
        if look > SAME_LOOK:
            return "opacities or colours change from file to file"
        if _median((state.means - before.means).norm(dim=-1)) > LONGEST_STEP * radius:
            return "their order changes from file to file"
    return ""


def _largest(change: Tensor) -> float:
    return float(change.abs().max()) if change.numel() else 0.0


def _median(values: Float[Tensor, " n"]) -> float:
    return float(values.median()) if len(values) else 0.0


def _keyed(
    states: Sequence[Gaussians], times_s: Sequence[float]
) -> tuple[Gaussians, KeyframeMotion]:
    first = states[0]
    index = torch.stack([_moved(first, state) for state in states]).any(0).nonzero()[:, 0]
    start = first.select(index)
    inverse = quaternion.conjugate(quaternion.normalize(start.quats))
    others = [state.select(index) for state in states]
    motion = KeyframeMotion(
        key_times_s=torch.tensor(times_s),
        moving_index=index,
        offsets=torch.stack([state.means - start.means for state in others]),
        rotations=torch.stack([quaternion.multiply(inverse, state.quats) for state in others]),
        log_scale_offsets=torch.stack([_log_ratio(state.scales, start.scales) for state in others]),
    )
    return first, motion


def _moved(first: Gaussians, state: Gaussians) -> Bool[Tensor, " n"]:
    parts = [(getattr(first, name) != getattr(state, name)).any(-1) for name in _MOVING]
    return torch.stack(parts).any(0)


_MOVING = ("means", "quats", "scales")


def _log_ratio(scales: Tensor, start: Tensor) -> Tensor:
    return scales.clamp_min(1e-30).log() - start.clamp_min(1e-30).log()
