"""Any motion as key frames, which is what the page plays, with the error that this makes."""

from dataclasses import dataclass, replace

import torch

from diff4splat.scene.motion.bake import bake, bake_within
from diff4splat.scene.motion.keyframe_algebra import resample
from diff4splat.scene.motion.keyframes import KeyframeMotion
from diff4splat.scene.motion.static import StaticMotion
from diff4splat.scene.scene import Scene

TOLERANCE_PX = 0.1
MAX_KEYS = 256
"""Layers that every WebGL2 device has."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Keyframed:
    """A scene that the page can play."""

    scene: Scene
    notes: tuple[str, ...]
    """What differs from the scene it was made of, in words; empty if nothing does."""


def keyframed(scene: Scene) -> Keyframed:
    """The scene with static or key-framed motion."""
    motion = scene.motion
    if isinstance(motion, StaticMotion):
        return Keyframed(scene=scene, notes=())
    if not isinstance(motion, KeyframeMotion):
        return _baked(scene)
    if len(motion.moving_index) == 0:
        still = StaticMotion(time_range_s=motion.time_range_s)
        return Keyframed(scene=replace(scene, motion=still), notes=())
    if len(motion.key_times_s) <= MAX_KEYS:
        return Keyframed(scene=scene, notes=())
    start_s, stop_s = motion.time_range_s
    times_s = torch.linspace(start_s, stop_s, MAX_KEYS, dtype=motion.key_times_s.dtype)
    note = f"{MAX_KEYS} of {len(motion.key_times_s)} key times are kept, evenly spread"
    return Keyframed(scene=replace(scene, motion=resample(motion, times_s)), notes=(note,))


def _baked(scene: Scene) -> Keyframed:
    cameras = scene.path.cameras
    motion, error = bake_within(scene.gaussians, scene.motion, cameras, TOLERANCE_PX)
    if len(motion.key_times_s) > MAX_KEYS:
        motion, error = bake(scene.gaussians, scene.motion, MAX_KEYS, cameras)
    notes = [f"motion became {len(motion.key_times_s)} key times, {error.largest_px:.2g} px off"]
    if max(error.opacity_lost, error.color_lost) > 0:
        notes.append(
            "key frames hold neither opacity nor colour; left out: changes of up to "
            f"{error.opacity_lost:.3g} in opacity and {error.color_lost:.3g} in harmonics"
        )
    return Keyframed(scene=replace(scene, motion=motion), notes=tuple(notes))
