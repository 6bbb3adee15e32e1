"""A data set of physical cameras: what lies in it, and that its files tell the truth."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from filmed_scenes import WALL_DEPTH, filmed_scene, png_rgb

from diff4splat.errors import ConfigError, InputError, OutputError
from diff4splat.geometry.lenses.build import equirectangular_camera, fisheye_camera
from diff4splat.geometry.lenses.equirectangular import Equirectangular
from diff4splat.geometry.lenses.opencv_fisheye import OpenCVFisheye
from diff4splat.geometry.optics import Aperture, Optics, Shutter
from diff4splat.io.cameras.camera_record import read_camera_record
from diff4splat.io.exr import read_depth_exr
from diff4splat.io.photos.images import write_png
from diff4splat.outputs.camera_dataset import writer
from diff4splat.outputs.camera_dataset.sequences import EFFECTS, EffectChoice, effect_sequences
from diff4splat.outputs.camera_dataset.writer import DatasetJob, write_camera_dataset
from diff4splat.outputs.photo_sequence import geometry_kind, needs_rays
from diff4splat.paths.physical_path import PhysicalPath, filmed
from diff4splat.progress.run_log import RunLog
from diff4splat.render.api import render
from diff4splat.render.physical.api import photograph
from diff4splat.render.physical.settings import PhotoSettings
from diff4splat.scene.scene import Scene

SETTINGS = PhotoSettings(samples=4, seed=5)


def fisheye(fov_deg: float = 180.0) -> OpenCVFisheye:
    return OpenCVFisheye(
        coefficients=torch.zeros(4, dtype=torch.float64),
        max_angle_rad=fov_deg / 360 * torch.pi,
    )


def choice(scene: Scene, readout_s: float = 0.04) -> EffectChoice:
    cameras, lens = scene.path.cameras, fisheye()
    camera = fisheye_camera(180.0, cameras.size_px, lens, torch.float64)
    poses = cameras.world_from_camera.double()
    return EffectChoice(
        path=scene.path,
        lens=lens,
        lens_path=replace(scene.path, cameras=camera.with_pose(poses)),
        aperture=Aperture(radius=0.1, focus_distance=2.0),
        shutter=Shutter(readout_s=readout_s),
        exposure_s=0.05,
    )


def job(scene: Scene) -> DatasetJob:
    return DatasetJob(scene=scene, sequences=effect_sequences(choice(scene)), settings=SETTINGS)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One data set that several tests look at."""
    out = tmp_path_factory.mktemp("film") / "set"
    write_camera_dataset(job(filmed_scene()), out, RunLog())
    return out


def test_every_effect_has_its_folder_and_nothing_else_is_there(folder: Path) -> None:
    assert {path.name for path in folder.iterdir()} == {
        *EFFECTS,
        "dataset.json",
        "contact-sheet.png",
    }
    plain = {"camera.json", "frame_0000.png", "frame_0001.png", "depth"}
    for name in EFFECTS:
        blind = {"valid.png"} if name in ("fisheye", "combined") else set()
        assert {path.name for path in (folder / name).iterdir()} == plain | blind, name
    assert png_rgb(folder / "contact-sheet.png").shape[1] > 900


@pytest.mark.parametrize("name", EFFECTS)
def test_the_same_images_come_of_what_the_file_says(
    folder: Path, tmp_path: Path, name: str
) -> None:
    own = read_camera_record(folder / name / "camera.json")
    scene = filmed_scene()
    for index, taken in enumerate(own.frames):
        photo = photograph(
            scene,
            own.physical_path.camera(index),
            own.physical_path.time_s(index),
            outputs=("rgb", own.geometry),
            settings=own.settings,
        )
        write_png(photo.rgb, tmp_path / "again.png")
        again = (tmp_path / "again.png").read_bytes()
        assert again == (folder / name / taken.image).read_bytes()
        depth, _ = read_depth_exr(folder / name / taken.geometry)
        assert torch.equal(depth[0], photo.depth)


def test_the_file_holds_the_cameras_that_were_asked_for(folder: Path) -> None:
    asked = effect_sequences(choice(filmed_scene()))
    for name, want in asked.items():
        own = read_camera_record(folder / name / "camera.json")
        assert torch.equal(own.physical_path.path.times_s, want.path.times_s)
        assert torch.equal(own.physical_path.track.world_from_camera, want.track.world_from_camera)
        assert torch.equal(own.physical_path.path.cameras.focal_px, want.path.cameras.focal_px)
        assert own.physical_path.optics.aperture == want.optics.aperture
        assert own.physical_path.optics.shutter == want.optics.shutter
        assert own.physical_path.optics.exposure_s == want.optics.exposure_s
    combined = asked["combined"].optics
    assert None not in (combined.aperture, combined.shutter)
    assert combined.exposure_s > 0


def test_effects_differ_and_the_pinhole_is_what_the_renderer_draws(folder: Path) -> None:
    images = {name: (folder / name / "frame_0001.png").read_bytes() for name in EFFECTS}
    assert len(set(images.values())) == len(EFFECTS)
    scene = filmed_scene()
    expected = render(scene, scene.path.cameras[1], float(scene.path.times_s[1])).rgb
    got = png_rgb(folder / "pinhole" / "frame_0001.png")
    torch.testing.assert_close(got, expected.clamp(0, 1), atol=0.5 / 255 + 1e-5, rtol=0)


def test_the_list_says_what_was_taken_and_left_out(folder: Path) -> None:
    root = json.loads((folder / "dataset.json").read_text())
    assert (root["license"], root["frames"]) == ("CC0-1.0", 2)
    listed = {entry["name"]: entry for entry in root["sequences"]}
    assert tuple(listed) == EFFECTS
    assert listed["combined"]["samples"] == 4
    assert listed["rolling-shutter"]["samples"] == 1
    assert listed["fisheye"]["blind_share"] > 0
    assert any("rasteriser" in line for line in listed["pinhole"]["left_out"])
    assert listed["pinhole"]["blind_share"] == 0


def test_blind_pixels_are_black_in_the_mask_and_the_image(folder: Path) -> None:
    mask = png_rgb(folder / "fisheye" / "valid.png")[..., 0]
    assert set(mask.unique().tolist()) == {0.0, 1.0}
    assert float(mask[0, 0]) == 0
    assert float(mask[5, 6]) == 1
    image = png_rgb(folder / "fisheye" / "frame_0000.png")
    assert not image[mask == 0].any()


def test_a_stopped_clock_is_told_and_only_the_camera_moves(tmp_path: Path) -> None:
    scene = filmed_scene()
    sequences = {"pinhole": effect_sequences(choice(scene))["pinhole"]}
    wanted = replace(job(scene), sequences=sequences, time_s=0.25)
    write_camera_dataset(wanted, tmp_path / "set", RunLog())
    own = read_camera_record(tmp_path / "set" / "pinhole" / "camera.json")
    assert own.scene_time_s == 0.25
    still = scene.state_at(0.25)
    expected = render(still, scene.path.cameras[1]).rgb.clamp(0, 1)
    got = png_rgb(tmp_path / "set" / "pinhole" / "frame_0001.png")
    torch.testing.assert_close(got, expected, atol=0.5 / 255 + 1e-5, rtol=0)


def test_a_lens_that_looks_behind_itself_gets_distances(tmp_path: Path) -> None:
    scene = filmed_scene(1)
    cameras = equirectangular_camera((6, 12), torch.float64)
    poses = scene.path.cameras.world_from_camera.double()
    path = filmed(
        replace(scene.path, cameras=cameras.with_pose(poses)), Optics(lens=Equirectangular())
    )
    assert geometry_kind(path) == "distance"
    wanted = replace(job(scene), sequences={"all-round": path})
    write_camera_dataset(wanted, tmp_path / "set", RunLog())
    own = tmp_path / "set" / "all-round"
    assert {path.name for path in own.iterdir()} == {"camera.json", "frame_0000.png", "distance"}
    values, _ = read_depth_exr(own / "distance" / "frame_0000.exr", "distance")
    assert float(values.max()) > WALL_DEPTH
    assert read_camera_record(own / "camera.json").geometry == "distance"


@pytest.mark.parametrize(
    ("fov_deg", "kind"), [(90.0, "depth"), (180.0, "depth"), (200.0, "distance")]
)
def test_depth_is_for_lenses_that_look_ahead(fov_deg: float, kind: str) -> None:
    lens = fisheye(fov_deg)
    camera = fisheye_camera(fov_deg, (10, 12), lens, torch.float64)
    path = replace(
        filmed_scene(1).path.to(torch.float64),
        cameras=camera.with_pose(torch.eye(4, dtype=torch.float64)[None]),
    )
    assert geometry_kind(PhysicalPath(path=path, optics=Optics(lens=lens))) == kind


def test_a_folder_with_other_files_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(ConfigError, match=r"expected a new or empty folder, got .* notes\.txt"):
        write_camera_dataset(job(filmed_scene()), tmp_path, RunLog())
    assert [path.name for path in tmp_path.iterdir()] == ["notes.txt"]


@pytest.mark.parametrize("failing", ["write_png", "write_depth_exr", "write_camera_record"])
def test_a_failure_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, failing: str
) -> None:
    whole, count = getattr(writer, failing), [0]

    def second_fails(*arguments, **more):
        count[0] += 1
        if count[0] == 2:
            raise OSError(28, "No space left on device")
        return whole(*arguments, **more)

    monkeypatch.setattr(writer, failing, second_fails)
    with pytest.raises(OutputError, match="the disk is full"):
        write_camera_dataset(job(filmed_scene()), tmp_path / "set", RunLog())
    assert not (tmp_path / "set").exists()


def test_a_frame_must_be_over_when_the_next_begins() -> None:
    with pytest.raises(InputError, match=r"combined: expected read-out and exposure of at most"):
        effect_sequences(choice(filmed_scene(), readout_s=0.06))


def test_rays_are_needed_only_where_something_shows() -> None:
    scene = filmed_scene()
    sequences = effect_sequences(choice(scene))
    needs = {name: needs_rays(scene, path, SETTINGS) for name, path in sequences.items()}
    assert needs == {name: name != "pinhole" for name in EFFECTS}
