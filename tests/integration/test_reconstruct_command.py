"""``diff4splat reconstruct``: from a folder with cameras to a scene in their world."""

import json
from pathlib import Path

import numpy as np
import pytest
from small_fits import ball_capture, write_ball_folder
from textured_clips import textured_clip

from diff4splat.cli.main import run
from diff4splat.data.shard_writer import ShardOptions, ShardWriter
from diff4splat.io.photos.images import write_png
from diff4splat.io.pixels import unit_rgb
from diff4splat.io.scene_files.scene_file import load_scene

FRAMES, UNIT = 17, 30.0


def write_video(folder: Path) -> Path:
    """Textured planes along a path, as nerfstudio's transforms.json in a unit of its own."""
    view, frames = textured_clip(FRAMES).views[0], []
    for index in range(FRAMES):
        write_png(unit_rgb(view.rgb[index]), folder / f"images/{index:02d}.png")
        pose = view.cameras.world_from_camera[index].numpy() @ np.diag([1.0, -1.0, -1.0, 1.0])
        pose[:3, 3] *= UNIT
        frames.append(
            {
                "file_path": f"images/{index:02d}.png",
                "time": index / 8,
                "transform_matrix": pose.tolist(),
            }
        )
    height, width = view.cameras.size_px
    lens = {
        "fl_x": 110.0,
        "fl_y": 110.0,
        "cx": width / 2,
        "cy": height / 2,
        "w": width,
        "h": height,
    }
    (folder / "transforms.json").write_text(json.dumps(lens | {"frames": frames}))
    return folder


@pytest.fixture(scope="module")
def video(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_video(tmp_path_factory.mktemp("video"))


def reconstruct(data: Path, out: Path, *more: str) -> int:
    return run(["reconstruct", str(data), "--out", str(out), *more])


def test_the_bundled_weights_find_unit_and_scene(
    video: Path, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    """The median depth is about 7 in the unit of the planes."""
    assert reconstruct(video, tmp_path / "out") == 0
    said = capsys.readouterr().err
    assert "Median depth: " in said and "units of the cameras, found" in said
    card = json.loads((tmp_path / "out/card.json").read_text())
    quality, scale = card["inputs"]["quality"], card["inputs"]["scale"]
    assert scale["observable"] and 0.7 < 4.0 / scale["factor"] / (6.5 * UNIT) < 1.4
    assert quality["input_frames_db"] > 22 and quality["other_frames_db"] > 20
    scene = load_scene(tmp_path / "out/scene.safetensors")
    assert scene.provenance.generator.endswith("reconstruction")
    names = {file.name for file in (tmp_path / "out").iterdir()}
    assert {"scene.safetensors", "scene.html", "depth.exr", "preview.png", "card.json"} <= names


@pytest.mark.slow
def test_a_scene_starts_a_fit_of_the_same_data(video: Path, tmp_path: Path) -> None:
    assert reconstruct(video, tmp_path / "out", "--photometric-steps", "0") == 0
    start = str(tmp_path / "out/scene.safetensors")
    arguments = [
        "fit",
        str(video),
        "--init",
        start,
        "--out",
        str(tmp_path / "fit"),
        "--steps",
        "10",
    ]
    assert run([*arguments, "--set", "coarse_steps=10"]) == 0


def test_the_depth_can_be_given_and_options_are_on_the_card(
    video: Path, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    options = ("--model", "test", "--median-depth", "200", "--frames", "5", "--resolution", "32")
    assert reconstruct(video, tmp_path / "out", *options, "--photometric-steps", "2") == 0
    assert "200 units of the cameras, given" in capsys.readouterr().err
    card = json.loads((tmp_path / "out/card.json").read_text())
    assert card["untrained"] and card["inputs"]["median_depth"] == 200
    assert card["inputs"]["scale"]["factor"] == pytest.approx(4 / 200)


def test_without_a_depth_prior_it_says_that_the_unit_is_not_shown(
    video: Path, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    options = ("--model", "test", "--resolution", "32", "--frames", "5")
    assert reconstruct(video, tmp_path / "out", *options) == 0
    said = capsys.readouterr().err
    assert "not shown by the video" in said and "give --median-depth" in said


def test_a_clip_is_read_as_fit_reads_it(tmp_path: Path) -> None:
    with ShardWriter(tmp_path / "clips", ShardOptions(generator="test 1")) as writer:
        writer.write(textured_clip(FRAMES))
    options = ("--model", "test", "--resolution", "32", "--frames", "5")
    assert reconstruct(tmp_path / "clips", tmp_path / "out", *options) == 0


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--camera", "7"), "--camera: expected one of"),
        (("--camera", "0"), "at least 5 frames of one camera at different times, got"),
        (("--format", "neu3d"), "expected videos or images of cameras"),
    ],
)
def test_what_is_no_video_is_refused(
    options: tuple[str, ...], message: str, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    write_ball_folder(tmp_path / "balls", ball_capture(times=3))
    assert reconstruct(tmp_path / "balls", tmp_path / "out", "--model", "test", *options) == 2
    assert message in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_results_do_not_overwrite_the_data(video: Path, capsys: pytest.CaptureFixture) -> None:
    assert reconstruct(video / "transforms.json", video / "transforms.json") == 2
    assert (video / "transforms.json").is_file()
