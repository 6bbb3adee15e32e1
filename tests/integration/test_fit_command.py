"""``diff4splat fit`` and ``bake``, from a folder of images to key frames."""

import json
from pathlib import Path

import pytest
import torch
from PIL import Image
from small_fits import ball_capture, write_ball_folder

from diff4splat.cli.main import run
from diff4splat.io.scene_files.scene_file import load_scene
from diff4splat.scene.motion.hexplane.motion import HexPlaneMotion
from diff4splat.scene.motion.keyframes import KeyframeMotion
from diff4splat.scene.motion.spacetime import SpacetimeMotion

QUICK = ("coarse_steps=30", "harmonics=0", "stillness.min_score=0.01", "judge_every=20",
         "stillness.offset_px=0.0", "planes.space=[8,8,8]", "planes.time=4",
         "decoder.width=16", "points=300")  # fmt: skip


def fit(data: Path, out: Path, *more: str) -> int:
    return run(["fit", str(data), "--out", str(out), "--steps", "40", *more, "--set", *QUICK])


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("data")
    write_ball_folder(folder, ball_capture(times=3))
    return folder


@pytest.mark.parametrize(
    ("motion", "kind"),
    [
        ("hexplane", HexPlaneMotion),
        pytest.param("spacetime", SpacetimeMotion, marks=pytest.mark.slow),
    ],
)
def test_a_folder_becomes_a_scene_with_a_card(
    motion: str, kind: type, data: Path, tmp_path: Path, capsys: pytest.CaptureFixture
):
    out = tmp_path / "fit"
    assert fit(data, out, "--motion", motion) == 0
    told = capsys.readouterr().err
    assert "12 frames to learn from, 3 held out (new views)" in told
    assert "dB held out" in told and "held out (new views):" in told
    scene = load_scene(out / "scene.safetensors")
    assert isinstance(scene.motion, kind)
    assert scene.provenance.generator.endswith(f"fit --motion {motion}")
    card = json.loads((out / "card.json").read_text())
    assert card["finished"] and card["held_out"]["frames"] == 3
    assert card["scene"]["moving_gaussians"] == len(scene.motion.moving_index)
    assert card["capture"]["format"].startswith("nerfstudio")
    with Image.open(out / "comparison.png") as image:
        assert image.size[0] > 1000
    assert (out / "video.mp4").stat().st_size > 0
    assert run(["render", str(out / "scene.safetensors"), "--out", str(tmp_path / "v.png")]) == 0


def test_a_fitted_field_bakes_to_key_frames(
    data: Path, tmp_path: Path, capsys: pytest.CaptureFixture
):
    assert fit(data, tmp_path / "fit") == 0
    file = tmp_path / "fit" / "scene.safetensors"
    assert run(["bake", str(file), "--out", str(tmp_path / "baked.safetensors")]) == 0
    assert "px off" in capsys.readouterr().err
    baked, scene = load_scene(tmp_path / "baked.safetensors"), load_scene(file)
    assert isinstance(baked.motion, KeyframeMotion)
    torch.testing.assert_close(
        baked.state_at(0.4).means, scene.state_at(0.4).means, atol=0.02, rtol=0
    )


@pytest.mark.slow
def test_a_fit_in_float64_keeps_every_bit(data: Path, tmp_path: Path) -> None:
    out, exact = tmp_path / "fit", ("--dtype", "float64", "--compression", "lossless")
    assert fit(data, out, *exact, "--set", "coarse_steps=5", "points=40") == 0
    scene = load_scene(out / "scene.safetensors")
    assert scene.gaussians.means.dtype == torch.float64
    assert not torch.equal(scene.gaussians.means, scene.gaussians.means.float().double())
    card = json.loads((out / "card.json").read_text())
    assert card["settings"]["dtype"] == card["inputs"]["dtype"] == "float64"
    assert card["finished"] and card["forecast"] is None
    with Image.open(out / "comparison.png") as image:
        assert image.size[0] > 1000


def test_stopped_by_the_clock_it_goes_on(data: Path, tmp_path: Path, capsys: pytest.CaptureFixture):
    out = tmp_path / "fit"
    assert fit(data, out, "--minutes", "0.0001") == 0
    assert "the same command goes on" in capsys.readouterr().err
    assert not json.loads((out / "card.json").read_text())["finished"]
    assert fit(data, out) == 0
    assert "going on from" in capsys.readouterr().err
    assert json.loads((out / "card.json").read_text())["finished"]


def test_another_fit_in_the_folder_is_refused_until_restart(
    data: Path, tmp_path: Path, capsys: pytest.CaptureFixture
):
    out = tmp_path / "fit"
    assert fit(data, out, "--minutes", "0.0001") == 0
    assert fit(data, out, "--seed", "3") == 2
    assert "--restart" in capsys.readouterr().err
    assert fit(data, out, "--seed", "3", "--restart", "--minutes", "0.0001") == 0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--minutes", "0"], "--minutes: expected more than 0"),
        (["--set", "nonsense=1"], "expected the keys"),
        (["--set", "weights.nonsense=1"], "expected the keys"),
        (["--set", "nonsense.ssim=1"], "expected a group such as"),
        (["--set", "points=none"], "expected int"),
        (["--set", "points=0"], "expected at least 1"),
        (["--format", "tape"], "tape"),
        (["--dtype", "float64", "--renderer", "raster"], "--renderer auto, trace or reference"),
        (["--dtype", "float64", "--device", "auto"], "and the CPU, got --renderer auto --device"),
    ],
)
def test_bad_options_end_in_one_line(
    arguments: list[str], message: str, data: Path, tmp_path: Path, capsys: pytest.CaptureFixture
):
    assert run(["fit", str(data), "--out", str(tmp_path / "fit"), *arguments]) == 2
    told = capsys.readouterr().err
    assert message in told and told.strip().count("\n") == 0
    assert not (tmp_path / "fit").exists()


def test_an_empty_folder_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture):
    (tmp_path / "nothing").mkdir()
    assert run(["fit", str(tmp_path / "nothing"), "--out", str(tmp_path / "fit")]) == 2
    assert "expected" in capsys.readouterr().err
