"""``diff4splat convert`` of checkpoints that other programs wrote."""

from pathlib import Path

import oracles_spacetime
import pytest
import torch
from oracles_fourdgs import random_cloud, random_state, write_folder
from torch import Tensor

from diff4splat.cli.main import run
from diff4splat.io.checkpoints.fourdgs_checkpoint import read_fourdgs_checkpoint
from diff4splat.io.checkpoints.native_4dgs_checkpoint import read_native_4dgs_checkpoint
from diff4splat.io.checkpoints.native_4dgs_import import from_raw_4d
from diff4splat.io.ply.ply_file import read_ply
from diff4splat.io.scene_files.scene_file import load_scene
from diff4splat.scene.motion.hexplane.motion import HexPlaneMotion
from diff4splat.scene.motion.spacetime import SpacetimeMotion


def capture(count: int = 5, env_map: Tensor | None = None, rot_4d: bool = True) -> tuple:
    """What the program's ``GaussianModel.capture`` returns, optimiser state included."""
    ones = oracles_spacetime.primitives(count, orders=3, bands=16)
    shape, colors = ones.covariance, ones.orders.flatten(1, 2)
    values = {
        "xyz": shape.means[:, :3],
        "dc": colors[:, :1],
        "rest": colors[:, 1:],
        "scaling": shape.scales[:, :3].log(),
        "rotation": shape.left_quats,
        "opacity": ones.opacities.logit()[:, None],
        "t": shape.means[:, 3:],
        "scaling_t": shape.scales[:, 3:].log(),
        "rotation_r": shape.right_quats,
    }
    p = {name: torch.nn.Parameter(value.float().clone()) for name, value in values.items()}
    optimizer = torch.optim.Adam([{"params": [p["xyz"]], "name": "xyz"}], lr=0.1)
    p["xyz"].sum().backward()
    optimizer.zero_grad()
    zeros = torch.zeros(count, 1)
    return (
        *(3, p["xyz"], p["dc"], p["rest"], p["scaling"], p["rotation"], p["opacity"]),
        *(torch.zeros(count), zeros, zeros, zeros, optimizer.state_dict(), 1.5),
        *(p["t"], p["scaling_t"], p["rotation_r"], rot_4d, env_map, 2),
    )


def write_checkpoint(file: Path, values: object = None) -> Path:
    torch.save((capture() if values is None else values, 30_000), file)
    return file


def test_a_fourdgs_folder_becomes_a_scene_file(tmp_path: Path) -> None:
    model, out = tmp_path / "model", tmp_path / "scene.safetensors"
    write_folder(model, random_state(), random_cloud(20))
    assert run(["convert", str(model), "--out", str(out), "--time-range", "0", "2"]) == 0
    scene = load_scene(out)
    gaussians, motion = read_fourdgs_checkpoint(model, duration_s=2.0)
    assert isinstance(scene.motion, HexPlaneMotion)
    assert scene.motion.time_range_s == (0.0, 2.0)
    assert len(scene.path) == 49
    assert "4DGaussians" in scene.provenance.generator
    for time_s in (0.0, 0.7, 2.0):
        got, want = scene.state_at(time_s), motion.state_at(gaussians, time_s)
        assert torch.equal(got.means, want.means)
        assert torch.equal(got.quats, want.quats)


def test_a_fourdgs_folder_becomes_ply_files(tmp_path: Path) -> None:
    model, out = tmp_path / "model", tmp_path / "ply"
    write_folder(model, random_state(), random_cloud(20))
    assert run(["convert", str(model), "--out", str(out), "--fps", "4"]) == 0
    assert len(list(out.glob("*.ply"))) == 5


def test_a_native_checkpoint_becomes_a_scene_file(tmp_path: Path) -> None:
    file, out = write_checkpoint(tmp_path / "chkpnt30000.pth"), tmp_path / "scene.safetensors"
    assert run(["convert", str(file), "--out", str(out), "--time-range", "-1", "1"]) == 0
    scene = load_scene(out)
    assert isinstance(scene.motion, SpacetimeMotion)
    assert scene.motion.time_range_s == (-1.0, 1.0)
    assert scene.motion.period_s == 2.0
    assert len(scene.gaussians) == 5
    primitives = from_raw_4d(read_native_4dgs_checkpoint(file).raw)
    assert torch.equal(scene.gaussians.means, primitives.covariance.means[:, :3])


def test_a_native_checkpoint_becomes_one_ply_file(tmp_path: Path) -> None:
    file, out = write_checkpoint(tmp_path / "chkpnt_best.pth"), tmp_path / "scene.ply"
    assert run(["convert", str(file), "--out", str(out), "--time", "0.1"]) == 0
    assert len(read_ply(out)) == 5


def test_the_default_camera_sees_the_scene(tmp_path: Path) -> None:
    file, out = write_checkpoint(tmp_path / "a.pth"), tmp_path / "scene.safetensors"
    assert run(["convert", str(file), "--out", str(out)]) == 0
    image = tmp_path / "image.png"
    assert run(["render", str(out), "--out", str(image), "--resolution", "32"]) == 0
    assert image.stat().st_size > 100


def test_what_is_not_imported_is_noted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    values = capture(env_map=torch.zeros(3, 4, 4))
    file = write_checkpoint(tmp_path / "a.pth", values)
    assert run(["convert", str(file), "--out", str(tmp_path / "a.ply")]) == 0
    assert "environment map" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (capture(rot_4d=False), "rot_4d"),
        (capture()[:12], "19 values"),
        ((*capture()[:13], None, *capture()[14:]), "times_s: expected a tensor"),
        ((*capture()[:13], torch.zeros(4, 1), *capture()[14:]), "times_s: expected 5 Gaussians"),
        ((*capture()[:2], torch.zeros(5, 3), *capture()[3:]), "constant_colors: expected 5"),
    ],
)
def test_other_checkpoints_are_refused(
    values: tuple, message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = write_checkpoint(tmp_path / "a.pth", values)
    assert run(["convert", str(file), "--out", str(tmp_path / "a.ply")]) == 2
    assert message in capsys.readouterr().err
    assert not (tmp_path / "a.ply").exists()


def test_damaged_and_foreign_inputs_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = str(tmp_path / "a.ply")
    (tmp_path / "a.pth").write_bytes(b"not a torch file")
    assert run(["convert", str(tmp_path / "a.pth"), "--out", out]) == 2
    assert "torch file" in capsys.readouterr().err
    (tmp_path / "empty").mkdir()
    assert run(["convert", str(tmp_path / "empty"), "--out", out]) == 2
    assert "4DGaussians" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("times", "message"),
    [(("1", "0"), "START < STOP"), (("nan", "1"), "a finite number"), (("0.5", "1"), "start of 0")],
)
def test_impossible_time_ranges_are_refused(
    times: tuple[str, str], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_folder(tmp_path / "model", random_state(), random_cloud(3))
    command = ["convert", str(tmp_path / "model"), "--out", str(tmp_path / "a.ply")]
    assert run([*command, "--time-range", *times]) == 2
    assert message in capsys.readouterr().err


def test_a_scene_file_has_its_own_time_range(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, out = write_checkpoint(tmp_path / "a.pth"), tmp_path / "scene.safetensors"
    assert run(["convert", str(file), "--out", str(out)]) == 0
    again = ["convert", str(out), "--out", str(tmp_path / "a.ply")]
    assert run([*again, "--time-range", "0", "1"]) == 2
    assert "a scene file" in capsys.readouterr().err


def test_a_single_time_needs_a_single_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, out = write_checkpoint(tmp_path / "a.pth"), tmp_path / "scene.safetensors"
    assert run(["convert", str(file), "--out", str(out), "--time", "0"]) == 2
    assert "--time" in capsys.readouterr().err
