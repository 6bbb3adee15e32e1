"""What a scene file keeps of a scene, and what key frames keep of a motion.

Axes: ``t`` times, ``h w`` pixels.
"""

from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.error_time.camera_knobs import SIZE_PX, turning_scene
from diff4splat.error_time.subjects import scenes
from diff4splat.error_time.subjects.inputs import Inputs
from diff4splat.generation.settings import GenerationSettings
from diff4splat.geometry.camera import pinhole
from diff4splat.io.scene_files.compression import Compression
from diff4splat.io.scene_files.scene_file import load_scene, save_scene
from diff4splat.render.api import render
from diff4splat.scene.motion.bake import bake_within
from diff4splat.scene.motion.protocol import Motion

GAUSSIANS = 2_000
TIMES = 9


def kept(compression: Compression, inputs: Inputs) -> scenes.Scenes:
    """Scenes of the inputs, written and read again."""
    with TemporaryDirectory() as folder:
        files = [Path(folder) / f"{index}.safetensors" for index in inputs]
        for scene, file in zip(_generated(inputs), files, strict=True):
            save_scene(scene, file, compression)
        return [load_scene(file) for file in files]


def baked(tolerance_px: float | None) -> Float[Tensor, "t h w 3"]:
    """A turning cloud at times between its keys; None shows the motion itself."""
    scene, camera = turning_scene(GAUSSIANS), pinhole(float(SIZE_PX[1]), SIZE_PX)
    motion: Motion = scene.motion
    if tolerance_px is not None:
        at = camera.with_pose(torch.eye(4))
        motion, _ = bake_within(scene.gaussians, motion, at, tolerance_px)
    first_s, last_s = scene.motion.time_range_s
    times_s = [first_s + (last_s - first_s) * (k + 0.5) / TIMES for k in range(TIMES)]
    states = (motion.state_at(scene.gaussians, time_s) for time_s in times_s)
    return torch.stack([render(state, camera).rgb for state in states])


@cache
def _generated(inputs: Inputs) -> scenes.Scenes:
    return scenes.run(GenerationSettings(), inputs)
