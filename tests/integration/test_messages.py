"""What commands answer to options that cannot be meant, and what they print about a result."""

from pathlib import Path

import pytest
from filmed_scenes import filmed_scene
from PIL import Image

from diff4splat.cli.main import run
from diff4splat.cli.prepare import PrepareSynthetic
from diff4splat.data_prep.readers.registry import read_capture
from diff4splat.errors import ConfigError, InputError
from diff4splat.generation.inputs.image_size import find_image_size
from diff4splat.geometry.camera import pinhole
from diff4splat.io.cameras.path_files import write_path
from diff4splat.io.exr import read_depth_exr
from diff4splat.io.scene_files.scene_file import save_scene
from diff4splat.paths.build import build_path
from diff4splat.paths.settings import PathFrame, PathSettings


@pytest.fixture
def scene_file(tmp_path: Path) -> Path:
    """Three frames; the near dot moves from -0.5 to 0.5 s."""
    save_scene(filmed_scene(frames=3), tmp_path / "scene.safetensors")
    return tmp_path / "scene.safetensors"


def last_line(capsys: pytest.CaptureFixture) -> str:
    return capsys.readouterr().err.splitlines()[-1]


@pytest.mark.parametrize("side_px", [3, 1025, 4096])
def test_a_size_is_refused_with_a_range_that_it_could_be_in(side_px: int) -> None:
    with pytest.raises(ConfigError, match=f"expected 16 to 1024 pixels, got {side_px}"):
        find_image_size("small", side_px)


@pytest.mark.parametrize("out", ["view.png", "frame.ply"])
def test_a_time_that_the_scene_lacks_is_refused(
    out: str, scene_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    command = "render" if out == "view.png" else "convert"
    arguments = [command, str(scene_file), "--out", str(tmp_path / out)]
    assert run([*arguments, "--time", "99"]) == 2
    assert "--time: expected -0.5 to 0.5 seconds, as the scene has, got 99" in last_line(capsys)
    assert not (tmp_path / out).exists()
    assert run([*arguments, "--time", "0.5"]) == 0


def test_frames_and_rate_change_the_path_of_the_scene(
    scene_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    out = tmp_path / "depth.exr"
    options = ["--out", str(out), "--time", "0"]
    assert run(["render", str(scene_file), *options, "--frames", "7", "--fps", "5"]) == 0
    _, path = read_depth_exr(out)
    assert len(path) == 7
    assert float(path.times_s[1]) == pytest.approx(0.2)
    capsys.readouterr()
    assert run(["render", str(scene_file), *options, "--amplitude", "2"]) == 2
    assert "--amplitude, --easing: expected with presets" in last_line(capsys)


def test_a_format_that_is_not_written_is_no_folder(
    scene_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    out = tmp_path / "x.splat"
    assert run(["convert", str(scene_file), "--out", str(out)]) == 2
    assert "expected a name ending in .ply, .spz, .glb, .safetensors, .usdc" in last_line(capsys)
    assert not out.exists()
    out.mkdir()
    assert run(["convert", str(scene_file), "--out", str(out), "--fps", "2"]) == 0
    assert len(list(out.glob("*.ply"))) == 3


@pytest.mark.parametrize("name", ["view.mp4", "view.MOV", "absent.webm"])
def test_one_video_is_no_capture_and_its_folder_is_left_alone(name: str, tmp_path: Path) -> None:
    Image.new("RGB", (8, 8)).save(tmp_path / "picture.png")
    if "absent" not in name:
        (tmp_path / name).write_bytes(b"video")
    with pytest.raises(InputError, match="expected a folder with images, poses and times, got one"):
        read_capture(tmp_path / name)


def test_a_preview_says_for_which_image_its_focal_lengths_are(
    tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    view = PathFrame(camera=pinhole(100.0, (90, 160)), near_depth=1.0, focus_depth=1.0)
    write_path(build_path("arc", view, PathSettings(frames=3, fps=10.0)), tmp_path / "path.json")
    assert run(["paths", "preview", str(tmp_path / "path.json"), "--out", f"{tmp_path}/p.png"]) == 0
    assert "400 px in an image of 640 by 360 px" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("options", "share"),
    [({}, 0.25), ({"rig": True}, 0.0), ({"rig": True, "still_share": 1.0}, 1.0)],
)
def test_a_rig_stands_around_a_world_that_moves(options: dict, share: float) -> None:
    prepare = PrepareSynthetic(out=Path("out"), clips=1, **options)
    assert prepare.static_world_share() == share
