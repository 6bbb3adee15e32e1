"""A scene as one ONNX graph: ``time_s`` (1) in; means, quats, scales, opacities, sh out, float32.

Axes: ``n`` Gaussians. Shapes are static and there is no control flow, so that any runtime plays it.
Quaternions are (w, x, y, z), not normalised where nothing moves; axes are ours.
"""

from dataclasses import fields
from pathlib import Path

import torch

from diff4splat.errors import InputError
from diff4splat.io.atomic import atomic_path
from diff4splat.io.scene_onnx.graph import GraphBuilder, moments
from diff4splat.io.scene_onnx.keyframe_graph import add_keyframes
from diff4splat.io.scene_onnx.spacetime_graph import add_spacetime
from diff4splat.io.splats.require_finite import require_finite
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.keyframes import KeyframeMotion
from diff4splat.scene.motion.spacetime import SpacetimeMotion
from diff4splat.scene.scene import Scene


def write_scene_onnx(scene: Scene, file: Path) -> None:
    """Write key frames, native 4D Gaussians or a static scene, whole or not at all.

    Raises:
        InputError: another motion, a value that is not finite, or more than 2 GiB.
        MissingExtraError: onnx is not installed.
    """
    gaussians, motion = scene.gaussians, scene.motion
    require_finite(gaussians, str(file))
    builder = GraphBuilder()
    values: dict[str, str] = {}
    if len(motion.moving_index):
        match motion:
            case KeyframeMotion():
                values = add_keyframes(builder, gaussians, motion)
            case SpacetimeMotion():
                values = add_spacetime(builder, gaussians, motion)
            case _:
                raise InputError(f"{file}: expected key frames, got {type(motion).__name__}")
        builder.constant("moving_index", motion.moving_index[:, None])
    outputs = {}
    for field in fields(Gaussians):
        tensor = getattr(gaussians, field.name)
        stored = moments(builder, f"canonical_{field.name}", tensor)
        moved = values.get(field.name)
        placed = (
            stored if moved is None else builder.add("ScatterND", stored, "moving_index", moved)
        )
        builder.name_output(placed, field.name)
        outputs[field.name] = tuple(tensor.shape)
    with atomic_path(file) as temporary:
        temporary.write_bytes(builder.serialized(outputs, _notes(scene)))


def _notes(scene: Scene) -> dict[str, str]:
    start_s, stop_s = scene.motion.time_range_s
    return {
        "time_range_s": f"{start_s:.9g} {stop_s:.9g}",
        "axes": "x right, y down, z forward",
        "quats": "w x y z",
        "generator": scene.provenance.generator,
        "license": scene.provenance.license,
    }


class SceneOnnxReader:
    """States of a graph, computed by ONNX Runtime."""

    def __init__(self, file: Path) -> None:
        import onnxruntime

        options = onnxruntime.SessionOptions()
        options.log_severity_level = 3
        self._session = onnxruntime.InferenceSession(
            str(file), options, providers=["CPUExecutionProvider"]
        )

    def state_at(self, time_s: float) -> Gaussians:
        """The Gaussians at ``time_s``."""
        names = [field.name for field in fields(Gaussians)]
        found = self._session.run(names, {"time_s": torch.tensor([time_s]).float().numpy()})
        return Gaussians(
            **{name: torch.from_numpy(array) for name, array in zip(names, found, strict=True)}
        )
