"""Scenes as ONNX: ONNX Runtime computes what ``state_at`` does."""

from dataclasses import replace
from pathlib import Path

import oracles_hexplane
import oracles_io
import oracles_spacetime
import pytest
import torch

from diff4splat.errors import InputError
from diff4splat.io.scene_onnx.scene_onnx_file import SceneOnnxReader, write_scene_onnx
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.keyframes import KeyframeMotion
from diff4splat.scene.scene import Scene

pytest.importorskip("onnx", reason="pip install 'diff4splat[onnx]'")
TOLERANCE = 1e-5


def random_keys(interpolation: str, keys: int) -> Scene:
    torch.manual_seed(keys)
    motion = KeyframeMotion(
        key_times_s=torch.linspace(-0.3, 1.7, keys),
        moving_index=torch.tensor([0, 1, 3]),
        offsets=torch.randn(keys, 3, 3),
        rotations=torch.randn(keys, 3, 4),
        log_scale_offsets=torch.randn(keys, 3, 3) * 0.3,
        interpolation=interpolation,
    )
    motion.rotations[0, 0] = 0
    return replace(oracles_io.scene(), motion=motion)


SCENES = {
    "static": oracles_io.scene(moving=False),
    "golden": oracles_io.scene(),
    "spacetime": oracles_spacetime.file_scene(),
    **{f"{kind} {n}": random_keys(kind, n) for kind in ("linear", "cubic") for n in (1, 2, 5)},
}


@pytest.mark.parametrize("name", SCENES)
def test_every_time_gives_the_same_state(tmp_path: Path, name: str) -> None:
    scene = SCENES[name].to(torch.float32)
    write_scene_onnx(scene, tmp_path / "a.onnx")
    reader = SceneOnnxReader(tmp_path / "a.onnx")
    start_s, stop_s = scene.motion.time_range_s
    for time_s in torch.linspace(start_s - 1, stop_s + 1, 23).tolist():
        got, want = reader.state_at(time_s), scene.state_at(time_s)
        for field in Gaussians.__slots__:
            left, right = getattr(got, field), getattr(want, field)
            torch.testing.assert_close(left, right, atol=TOLERANCE, rtol=TOLERANCE)


def test_equal_scenes_have_equal_bytes_and_other_motions_are_refused(tmp_path: Path) -> None:
    for name in ("a.onnx", "b.onnx"):
        write_scene_onnx(oracles_io.scene(), tmp_path / name)
    assert (tmp_path / "a.onnx").read_bytes() == (tmp_path / "b.onnx").read_bytes()
    with pytest.raises(InputError, match="expected key frames"):
        write_scene_onnx(oracles_hexplane.file_scene(), tmp_path / "c.onnx")
