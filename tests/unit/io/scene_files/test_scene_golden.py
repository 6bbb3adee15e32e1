"""The committed scene file of version 1 must be readable for ever, with these values.

Its maker is ``oracles_io.write_golden``; the command stands at the top of that module.
"""

from pathlib import Path

import oracles_io
import torch

from diff4splat.io.scene_files.scene_file import load_scene, save_scene
from diff4splat.scene.motion.keyframes import KeyframeMotion


def test_version_1_keeps_loading_with_its_values() -> None:
    scene = load_scene(oracles_io.GOLDEN)
    assert len(scene.gaussians) == 4
    assert scene.gaussians.degree == 1
    assert scene.gaussians.means[1].tolist() == [-0.203125, -0.1875, -0.171875]
    assert scene.gaussians.quats[3].tolist() == [0.5, 0.5, 0.5, 0.5]
    assert scene.gaussians.scales[0].tolist() == [0.125, 0.140625, 0.15625]
    assert scene.gaussians.opacities.tolist() == [0.25, 0.265625, 0.28125, 0.296875]
    assert scene.gaussians.sh[3, 3].tolist() == [0.203125, 0.21875, 0.234375]
    assert scene.path.times_s.tolist() == [0.0, 0.25]
    assert scene.path.cameras.size_px == (6, 8)
    assert scene.path.cameras.world_from_camera[1, 0].tolist() == [1.0, 0.0, 0.0, 0.015625]
    assert scene.path.cameras.focal_px[0].tolist() == [10.0, 10.0]
    assert scene.path.cameras.center_px[0].tolist() == [4.0, 3.0]
    assert scene.provenance.prompt == "ein Glas Tee, grün"
    assert scene.provenance.seed == 7
    assert scene.provenance.license == "CC0-1.0"
    assert scene.provenance.untrained


def test_version_1_keeps_moving_as_it_did() -> None:
    scene = load_scene(oracles_io.GOLDEN)
    motion = scene.motion
    assert isinstance(motion, KeyframeMotion)
    assert motion.interpolation == "cubic"
    assert motion.key_times_s.tolist() == [0.0, 0.5, 2.0]
    assert motion.moving_index.tolist() == [1, 3]
    assert motion.offsets[2, 1].tolist() == [0.234375, 0.25, 0.265625]
    assert motion.rotations[0, 0].tolist() == [0.5, 0.5, 0.5, 0.5]
    assert motion.log_scale_offsets[0, 0].tolist() == [-0.125, -0.109375, -0.09375]
    last = scene.state_at(2.0)
    torch.testing.assert_close(last.means[1], torch.tensor([-0.015625, 0.015625, 0.046875]))
    torch.testing.assert_close(last.means[0], scene.gaussians.means[0], rtol=0, atol=0)


def test_the_writer_still_makes_the_same_bytes(tmp_path: Path) -> None:
    save_scene(oracles_io.scene(), tmp_path / "again.safetensors")
    assert (tmp_path / "again.safetensors").read_bytes() == oracles_io.GOLDEN.read_bytes()
