"""Physical cameras from their own files: one, several, and data sets of effects."""

import json
import shutil
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from filmed_scenes import filmed_scene, png_rgb

from diff4splat.data.capture.split import report_split
from diff4splat.data_prep.readers.options import ReadOptions
from diff4splat.data_prep.readers.registry import detect_format, read_capture
from diff4splat.errors import ConfigError, FileFormatError, InputError
from diff4splat.geometry.lenses.build import fisheye_camera
from diff4splat.geometry.lenses.opencv_fisheye import OpenCVFisheye
from diff4splat.geometry.optics import Aperture, Optics, Shutter
from diff4splat.outputs.camera_dataset.writer import DatasetJob, write_camera_dataset
from diff4splat.paths.physical_path import PhysicalPath, filmed
from diff4splat.progress.run_log import RunLog
from diff4splat.render.physical.settings import PhotoSettings

FRAMES = 3


def bent(shift: float = 0.0, radius: float = 0.05) -> PhysicalPath:
    """A fisheye with everything, ``shift`` to the right of the usual path."""
    path = filmed_scene(FRAMES).path.to(torch.float64)
    lens = OpenCVFisheye(coefficients=torch.zeros(4, dtype=torch.float64), max_angle_rad=1.5)
    camera = fisheye_camera(150.0, path.cameras.size_px, lens, torch.float64)
    poses = path.cameras.world_from_camera.clone()
    poses[:, 0, 3] += shift
    optics = Optics(
        lens=lens,
        aperture=Aperture(radius=radius, focus_distance=2.0),
        shutter=Shutter(readout_s=0.03),
        exposure_s=0.05,
    )
    return filmed(replace(path, cameras=camera.with_pose(poses)), optics)


def straight() -> PhysicalPath:
    return filmed(filmed_scene(FRAMES).path, Optics())


def film(folder: Path, **sequences: PhysicalPath) -> None:
    job = DatasetJob(
        scene=filmed_scene(FRAMES), sequences=sequences, settings=PhotoSettings(samples=2)
    )
    write_camera_dataset(job, folder, RunLog())


@pytest.fixture(scope="module")
def films(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three data sets side by side; nobody changes them."""
    folder = tmp_path_factory.mktemp("films")
    for name, shift in (("cam0", 0.0), ("cam1", 0.3), ("cam2", -0.3)):
        film(folder / name, bent=bent(shift), pinhole=straight())
    return folder


@pytest.fixture
def own(films: Path, tmp_path: Path) -> Path:
    """One camera that a test may spoil."""
    shutil.copytree(films / "cam0" / "bent", tmp_path / "bent")
    return tmp_path / "bent"


def edit(file: Path, *keys: str | int, value: object) -> None:
    root = json.loads(file.read_text())
    place = root
    for key in keys[:-1]:
        place = place[key]
    place[keys[-1]] = value
    file.write_text(json.dumps(root))


def test_one_camera_comes_back_bit_for_bit(films: Path) -> None:
    capture, want = read_capture(films / "cam0" / "bent"), bent()
    for name in ("focal_px", "center_px", "world_from_camera"):
        assert torch.equal(getattr(capture.cameras, name), getattr(want.path.cameras, name))
    assert torch.equal(capture.times_s, want.path.times_s)
    assert torch.equal(capture.tracks[0].world_from_camera, want.track.world_from_camera)
    assert torch.equal(capture.tracks[0].times_s, want.track.times_s)
    assert capture.optics.aperture == want.optics.aperture
    assert capture.optics.shutter == want.optics.shutter
    assert torch.equal(capture.optics.lens.coefficients, want.optics.lens.coefficients)
    assert capture.physical_camera(1).track is capture.tracks[0]
    assert capture.license == "CC0-1.0"
    assert capture.source == "diff4splat cameras"


def test_images_depth_and_masks_are_those_of_the_files(films: Path) -> None:
    folder = films / "cam0" / "bent"
    frame = read_capture(folder).frames.read(1)
    assert torch.equal(frame.rgb, png_rgb(folder / "frame_0001.png"))
    assert torch.equal(frame.counts, png_rgb(folder / "valid.png")[..., 0] > 0)
    assert float(frame.depth.max()) > 1


def test_a_pinhole_is_an_ordinary_capture(films: Path) -> None:
    capture = read_capture(films / "cam0", ReadOptions(clip="pinhole"))
    assert capture.optics is None
    assert capture.tracks == {}
    assert capture.frames.read(0).counts is None


def test_times_are_held_out_of_one_camera_and_a_camera_of_three(films: Path) -> None:
    one = read_capture(films / "cam0" / "bent")
    assert one.held_out.tolist() == [True, False, False]
    assert "every 8th time held out" in one.split_reason
    several = read_capture(films, ReadOptions(clip="bent"))
    assert several.camera_index.tolist() == [0, 0, 0, 1, 1, 1, 2, 2, 2]
    assert several.held_out.tolist() == [True] * 3 + [False] * 6
    assert "camera 0 held out" in several.split_reason
    assert list(several.tracks) == [0, 1, 2]
    assert torch.equal(several.tracks[2].world_from_camera, bent(-0.3).track.world_from_camera)
    assert any("cam0 is 0, cam1 is 1, cam2 is 2" in note for note in several.notes)
    other = read_capture(films, ReadOptions(clip="bent", hold_out=(2,)))
    assert other.held_out.tolist() == [False] * 6 + [True] * 3
    assert "cameras 2 held out, as asked for" in other.split_reason


def test_images_that_training_sees_too_are_left_out(films: Path) -> None:
    capture = read_capture(films, ReadOptions(clip="pinhole", hold_out=(0,)))
    assert len(capture) == 6
    assert not capture.held_out.any()
    assert any("3 held-out images were left out" in note for note in capture.notes)


def test_cameras_may_lie_side_by_side(films: Path, tmp_path: Path) -> None:
    for name in ("cam0", "cam1"):
        shutil.copytree(films / name / "bent", tmp_path / name)
    capture = read_capture(tmp_path)
    assert len(capture) == 2 * FRAMES
    assert report_split(capture).held_out == 2


def test_folders_and_files_are_known(films: Path) -> None:
    places: Sequence[Path] = (
        films,
        films / "cam0",
        films / "cam0" / "dataset.json",
        films / "cam0" / "bent",
        films / "cam0" / "bent" / "camera.json",
    )
    assert [detect_format(place) for place in places] == ["cameras"] * len(places)


def test_one_effect_is_chosen(films: Path, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"the name of one effect as clip.*\(bent, pinhole\)"):
        read_capture(films)
    with pytest.raises(ConfigError, match="did you mean 'bent'"):
        read_capture(films, ReadOptions(clip="bend"))
    film(tmp_path / "only", bent=bent())
    assert read_capture(tmp_path / "only").optics is not None


def test_cameras_with_other_optics_are_refused_by_what_differs(films: Path, tmp_path: Path) -> None:
    shutil.copytree(films / "cam0" / "bent", tmp_path / "a")
    shutil.copytree(films / "cam1" / "bent", tmp_path / "b")
    edit(tmp_path / "b" / "camera.json", "optics", "aperture", "radius", value=0.25)
    with pytest.raises(FileFormatError, match=r"got optics\.aperture\.radius 0\.25 in place of 0"):
        read_capture(tmp_path)
    edit(tmp_path / "b" / "camera.json", "optics", "aperture", value=None)
    with pytest.raises(FileFormatError, match=r"optics\.aperture"):
        read_capture(tmp_path)


def test_smaller_images_have_shorter_readouts(films: Path) -> None:
    capture = read_capture(films / "cam0" / "bent", ReadOptions(downscale=2))
    # Ten lines became five: line 0 is the mean of lines 0 and 1, the last of 8 and 9.
    before, after = 0.03 * (torch.arange(10).double() / 9 - 0.5), capture.optics.shutter.readout_s
    line_s = after * (torch.arange(5).double() / 4 - 0.5)
    torch.testing.assert_close(line_s, before.view(5, 2).mean(1))
    assert capture.frames.read(0).rgb.shape == (5, 6, 3)
    with pytest.raises(ConfigError, match="a downscale that 10 lines can be divided by"):
        read_capture(films / "cam0" / "bent", ReadOptions(downscale=3))
    read_capture(films / "cam0", ReadOptions(downscale=3, clip="pinhole"))


@pytest.mark.parametrize(
    ("keys", "value", "says"),
    [
        (("frames", 1, "file"), "../x.png", "expected a path inside"),
        (("frames", 1, "file"), "x.png", "got no such file"),
        (("frames", 1, "depth"), "depth/x.exr", "got no such file"),
        (("valid",), "other.png", "got no such file"),
        (("optics", "lens", "model"), "odd", "'model': expected one of"),
        (("frames", 2, "time_s"), 0.15, "frame 2: expected the pose that 'track' has"),
        (("track", "times_s"), [0.0, 0.1], "expected a list of 3 numbers"),
    ],
)
def test_spoiled_files_are_named(own: Path, keys, value: object, says: str) -> None:
    edit(own / "camera.json", *keys, value=value)
    with pytest.raises(FileFormatError) as caught:
        read_capture(own)
    assert says in str(caught.value)
    assert "camera.json" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_damage_and_other_folders_are_told(own: Path, tmp_path: Path) -> None:
    text = (own / "camera.json").read_text()
    (own / "camera.json").write_text(text[: len(text) // 2])
    with pytest.raises(FileFormatError, match=r"camera\.json: line .*expected JSON"):
        read_capture(own)
    (own / "camera.json").write_text("{}")
    with pytest.raises(InputError, match="got none of these"):
        read_capture(own)
    with pytest.raises(FileFormatError, match=r"camera\.json: expected a diff4splat-camera file"):
        read_capture(tmp_path, ReadOptions(format="cameras"))


def test_distances_are_not_taken_for_depth(own: Path) -> None:
    root = json.loads((own / "camera.json").read_text())
    root["geometry"] = "distance"
    for frame in root["frames"]:
        frame["distance"] = frame.pop("depth")
    (own / "camera.json").write_text(json.dumps(root))
    capture = read_capture(own)
    assert capture.frames.read(0).depth is None
    assert any("distances were left out" in note for note in capture.notes)
