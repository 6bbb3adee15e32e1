"""The main path on the command line, with the ``test`` model: what appears, and that it agrees."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
import torch

from diff4splat.cli.main import run
from diff4splat.generation.pipeline import Diff4SplatPipeline
from diff4splat.io.exr import read_depth_exr
from diff4splat.io.photos.images import read_photo, write_png
from diff4splat.io.ply.ply_file import read_ply
from diff4splat.io.scene_files.scene_file import load_scene, save_scene
from diff4splat.metrics.image import psnr
from diff4splat.models.hub.model import load_model
from diff4splat.outputs import filming
from diff4splat.render.api import render, render_video

IMAGES = {"video.webm", "depth.exr", "preview.png"}
FILES = {"scene.safetensors", "scene.html", "card.json"} | IMAGES


@pytest.fixture(scope="module")
def photo(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A smooth colourful image of 3:2."""
    y, x = torch.meshgrid(torch.linspace(0, 6, 80), torch.linspace(0, 9, 120), indexing="ij")
    rgb = torch.stack([x.sin(), (x + y).cos(), (y * 2).sin()], -1) * 0.4 + 0.5
    file = tmp_path_factory.mktemp("photo") / "photo.png"
    write_png(rgb, file)
    return file


@pytest.fixture(scope="module")
def folder(photo: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One generation that several tests look at."""
    out = tmp_path_factory.mktemp("generated") / "scene"
    assert generate(photo, out) == 0
    return out


def generate(photo: Path, out: Path, *more: str) -> int:
    arguments = ["generate", str(photo), "--out", str(out), "--model", "test", "--frames", "4"]
    return run([*arguments, "--steps", "2", "--camera", "spiral", "--video", "webm", *more])


def test_every_promised_file_appears_and_nothing_else(folder: Path) -> None:
    assert {file.name for file in folder.iterdir()} == FILES


def test_the_card_says_what_was_done_and_left_out(folder: Path) -> None:
    card = json.loads((folder / "card.json").read_text())
    assert card["untrained"] is True
    assert card["inputs"]["seed"] == 0
    assert card["inputs"]["frames"] == 4
    assert "default, 30 mm" in card["inputs"]["focal_source"]
    assert card["scene"]["gaussians"] > 100
    assert card["scene"]["moving_gaussians"] == 0
    assert card["peak_memory_bytes"] > 0
    assert card["networks_run"] == ["vae", "dit", "ldrm", "deformation"]
    assert {"sample video", "reconstruct", "render", "write files"} <= set(card["seconds"])
    left_out = {entry["what"] for entry in card["left_out"]}
    assert {"text_encoder", "guidance pass", "deformation network"} <= left_out


def test_a_static_result_stores_no_key_times(folder: Path) -> None:
    from safetensors import safe_open

    with safe_open(folder / "scene.safetensors", framework="pt") as file:
        assert not [name for name in file.keys() if "key" in name or "offset" in name]  # noqa: SIM118


def test_the_first_view_is_the_photograph(folder: Path) -> None:
    assert json.loads((folder / "card.json").read_text())["first_view_psnr_db"] >= 28


def test_depth_file_holds_the_depth_and_the_cameras(folder: Path) -> None:
    scene = load_scene(folder / "scene.safetensors")
    depth, path = read_depth_exr(folder / "depth.exr")
    assert depth.shape == (4, *scene.path.cameras.size_px)
    torch.testing.assert_close(
        path.cameras.world_from_camera.float(), scene.path.cameras.world_from_camera
    )
    again = render(scene, scene.path.cameras[2], outputs=("depth",)).depth
    torch.testing.assert_close(depth[2], again)


def test_scene_file_and_ply_render_like_the_scene_in_memory(folder: Path, tmp_path: Path) -> None:
    scene = load_scene(folder / "scene.safetensors")
    ply = tmp_path / "scene.ply"
    assert run(["convert", str(folder / "scene.safetensors"), "--out", str(ply)]) == 0
    for index in (0, 3):
        expected = render(scene, scene.path.cameras[index]).rgb
        actual = render(read_ply(ply), scene.path.cameras[index]).rgb
        assert float(psnr(actual, expected)) >= 50


def test_a_ply_that_viewers_show_softer_is_said_to_be(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    scene, file = load_scene(folder / "scene.safetensors"), tmp_path / "scene.safetensors"
    for dilation_px2, said in ((0.0, True), (scene.dilation_px2, False)):
        save_scene(replace(scene, dilation_px2=dilation_px2), file)
        assert run(["convert", str(file), "--out", str(tmp_path / "scene.ply")]) == 0
        assert ("which the file cannot say" in capsys.readouterr().err) == said


def test_render_needs_nothing_but_the_scene_file(folder: Path, tmp_path: Path) -> None:
    scene_file = str(folder / "scene.safetensors")
    image = tmp_path / "view.png"
    assert run(["render", scene_file, "--out", str(image)]) == 0
    scene = load_scene(Path(scene_file))
    expected = render(scene, scene.path.cameras[0]).rgb.clamp(0, 1)
    assert float(psnr(read_photo(image).rgb, expected)) >= 50
    video = tmp_path / "view.mp4"
    options = ["--camera", "orbit:0.1", "--frames", "3", "--time", "0.05", "--resolution", "40"]
    assert run(["render", scene_file, "--out", str(video), *options]) == 0
    assert video.stat().st_size > 0


def test_two_runs_with_one_seed_are_bit_identical(
    folder: Path, photo: Path, tmp_path: Path
) -> None:
    assert generate(photo, tmp_path / "again") == 0
    for name in FILES - {"card.json"}:
        assert (tmp_path / "again" / name).read_bytes() == (folder / name).read_bytes(), name


def test_a_prompt_builds_the_text_encoder_and_guides(photo: Path, tmp_path: Path) -> None:
    assert generate(photo, tmp_path / "out", "--prompt", "a boat drifts to the left") == 0
    card = json.loads((tmp_path / "out" / "card.json").read_text())
    left_out = {entry["what"]: entry["why"] for entry in card["left_out"]}
    assert "text_encoder" not in left_out
    assert "encode text" in card["seconds"]
    assert card["provenance"]["prompt"] == "a boat drifts to the left"


def test_depth_is_blended_only_when_asked_for(
    photo: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = []

    def spy(*arguments: object, outputs: tuple[str, ...], **rest: object) -> object:
        asked.append(outputs)
        return render_video(*arguments, outputs=outputs, **rest)

    monkeypatch.setattr(filming, "render_video", spy)
    assert generate(photo, tmp_path / "out", "--skip-depth") == 0
    assert asked == [("rgb", "alpha")]
    names = {file.name for file in (tmp_path / "out").iterdir()}
    assert names == FILES - {"depth.exr"}


def test_a_field_of_view_overrides_and_is_reported(photo: Path, tmp_path: Path) -> None:
    assert generate(photo, tmp_path / "out", "--fov", "90") == 0
    scene = load_scene(tmp_path / "out" / "scene.safetensors")
    width, focal_px = scene.path.cameras.size_px[1], float(scene.path.cameras.focal_px[0, 0])
    assert focal_px == pytest.approx(width / 2, rel=0.25)
    assert (
        "--fov 90"
        in json.loads((tmp_path / "out" / "card.json").read_text())["inputs"]["focal_source"]
    )


def test_a_scene_that_stands_still_is_one_ply_file(folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "sequence"
    assert run(["convert", str(folder / "scene.safetensors"), "--out", str(out)]) == 0
    assert sorted(file.name for file in out.iterdir()) == ["check.json", "frame_0000.ply"]


def test_a_second_run_leaves_no_file_of_the_first_beside_its_own(
    photo: Path, tmp_path: Path
) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    assert generate(photo, tmp_path) == 0
    assert generate(photo, tmp_path, "--skip-depth") == 0
    names = {file.name for file in tmp_path.iterdir()}
    assert names == FILES - {"depth.exr"} | {"notes.txt"}


@pytest.mark.parametrize("frames", [2, 6, 25])
def test_a_moving_model_goes_all_the_way(photo: Path, tmp_path: Path, frames: int) -> None:
    pipeline = Diff4SplatPipeline(load_model("test"))
    for parameter in pipeline.model.networks.deformation.parameters():
        if not bool(parameter.any()):
            parameter.data = 0.05 * torch.randn(parameter.shape)
    pipeline.save_pretrained(tmp_path / "model")
    out = tmp_path / "out"
    more = ["--model", str(tmp_path / "model"), "--frames", str(frames), "--steps", "1"]
    assert run(["generate", str(photo), "--out", str(out), *more]) == 0
    card = json.loads((out / "card.json").read_text())
    assert card["scene"]["moving_gaussians"] > 100
    assert len(card["provenance"]["weights_sha256"]) == 64
    scene_file = str(out / "scene.safetensors")
    assert run(["convert", scene_file, "--out", str(tmp_path / "ply")]) == 0
    assert len(list((tmp_path / "ply").glob("*.ply"))) == frames
    scene = load_scene(out / "scene.safetensors")
    last_s, camera = float(scene.path.times_s[-1]), scene.path.cameras[0]
    expected = render(scene, camera, last_s).rgb
    actual = render(read_ply(tmp_path / "ply" / f"frame_{frames - 1:04d}.ply"), camera).rgb
    assert float(psnr(actual, expected)) >= 50
    assert not torch.equal(expected, render(scene, camera, 0.0).rgb)


def test_inspect_counts_parameters_without_allocating(capsys: pytest.CaptureFixture) -> None:
    assert run(["inspect", "--config", "paper"]) == 0
    shown = capsys.readouterr().out
    assert "dit" in shown
    total = int(shown.split()[-1].replace(",", ""))
    assert 5e9 < total < 3e10


def test_inspect_shows_a_scene(folder: Path, capsys: pytest.CaptureFixture) -> None:
    assert run(["inspect", str(folder / "scene.safetensors")]) == 0
    assert "untrained       True" in capsys.readouterr().out
