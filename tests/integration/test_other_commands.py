"""Paths, reports and help: commands that need no model."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from PIL import Image

from diff4splat.cli.main import run
from diff4splat.geometry.camera import pinhole
from diff4splat.io.cameras.path_files import write_path
from diff4splat.paths.build import build_path
from diff4splat.paths.presets import PRESETS
from diff4splat.paths.settings import PathFrame, PathSettings

SLOW = pytest.mark.slow
ASKED_FOR = {
    *("static", "orbit", "arc", "spiral", "forward", "backward", "up", "down", "left", "right"),
    *("roll", "dolly-zoom", "figure8"),
}


def assert_image(file: Path) -> None:
    with Image.open(file) as image:
        assert min(image.size) > 300
        assert len(set(image.convert("L").resize((64, 64)).tobytes())) > 10


@pytest.mark.parametrize(
    "camera",
    ["orbit:0.25+up:0.1", *(pytest.param(c, marks=SLOW) for c in ("spiral", "dolly-zoom"))],
)
def test_preview_draws_presets(camera: str, tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    assert run(["paths", "preview", camera, "--out", str(tmp_path / "p.png")]) == 0
    assert_image(tmp_path / "p.png")
    assert "focal length" in capsys.readouterr().out


@pytest.mark.parametrize(
    "name",
    [
        "path.txt",
        *(pytest.param(n, marks=SLOW) for n in ("path.tum", "transforms.json", "camera_path.json")),
    ],
)
def test_preview_and_generate_follow_every_file_format(name: str, tmp_path: Path) -> None:
    view = PathFrame(camera=pinhole(40.0, (32, 48)), near_depth=4.0, focus_depth=4.0)
    path = build_path("arc+forward", view, PathSettings(frames=7, fps=10.0))
    file = tmp_path / name
    write_path(path, file)
    assert run(["paths", "preview", str(file), "--out", str(tmp_path / "p.png")]) == 0
    assert_image(tmp_path / "p.png")
    Image.radial_gradient("L").convert("RGB").resize((48, 32)).save(tmp_path / "photo.png")
    arguments = ["generate", str(tmp_path / "photo.png"), "--model", "test", "--steps", "1"]
    assert run([*arguments, "--camera", str(file), "--out", str(tmp_path / "out")]) == 0
    card = json.loads((tmp_path / "out" / "card.json").read_text())
    assert card["scene"]["frames"] == 7
    assert card["first_view_psnr_db"] > 28


def test_every_preset_is_listed(capsys: pytest.CaptureFixture) -> None:
    assert run(["paths", "list"]) == 0
    shown = capsys.readouterr().out
    for name in ASKED_FOR:
        assert name in PRESETS
        assert name in shown


def test_error_time_writes_a_table_and_a_plot(
    tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    assert run(["report", "knobs"]) == 0
    assert "pruning" in capsys.readouterr().out
    out = tmp_path / "report"
    arguments = ["report", "error-time", "--knob", "pruning", "--repeats", "1"]
    assert run([*arguments, "--out", str(out)]) == 0
    assert_image(out / "error-time-pruning.png")
    assert "pruning" in (out / "error-time.md").read_text()
    assert json.loads((out / "error-time.json").read_text())
    assert run(["report", "error-time", "--knob", "magic", "--out", str(out)]) == 2
    assert "magic" in capsys.readouterr().err


@pytest.mark.parametrize(
    "command", [[], ["generate"], ["paths", "preview"], ["report", "error-time"]]
)
def test_help_reads_well_and_imports_no_torch(command: list[str]) -> None:
    arguments = [*command, "--help"]
    code = (
        "import sys\nfrom diff4splat.cli.main import run\n"
        f"try:\n    run({arguments})\nexcept SystemExit: pass\n"
        "assert 'torch' not in sys.modules and 'numpy' not in sys.modules\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "usage: diff4splat" in done.stdout


def test_a_reader_that_stops_early_is_no_error() -> None:
    done = subprocess.run(
        f"{sys.executable} -m diff4splat.cli.main --help | head -1",
        shell=True,
        capture_output=True,
        text=True,
        check=False,
    )
    assert "Traceback" not in done.stderr
