"""``diff4splat render`` through physical cameras, and every option that needs another one."""

from pathlib import Path

import numpy as np
import OpenEXR
import pytest
import torch
from filmed_scenes import DOT_DEPTH, WALL_DEPTH, filmed_scene, png_rgb

from diff4splat.cli.main import run
from diff4splat.cli.options.aperture import central_focus, f_stop_radius
from diff4splat.cli.options.lens import build_lens
from diff4splat.cli.options.optics import OpticsOptions, require_consistent
from diff4splat.cli.options.physical_path import choose_effects, choose_optics, to_photo_settings
from diff4splat.errors import ConfigError, InputError
from diff4splat.io.cameras.camera_record import read_camera_record
from diff4splat.io.exr import read_depth_exr
from diff4splat.io.photos.images import write_png
from diff4splat.io.scene_files.scene_file import load_scene, save_scene
from diff4splat.outputs.camera_dataset.sequences import EFFECTS
from diff4splat.render.physical.api import photograph


@pytest.fixture(scope="module")
def scene_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A scene that several tests look at."""
    file = tmp_path_factory.mktemp("scene") / "scene.safetensors"
    save_scene(filmed_scene(3), file)
    return file


def render(scene_file: Path, out: Path, *more: str) -> int:
    return run(["render", str(scene_file), "--out", str(out), *more])


def said(capsys: pytest.CaptureFixture) -> str:
    return capsys.readouterr().err


def test_a_camera_without_effects_gives_the_same_bytes_as_none(
    scene_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    assert render(scene_file, tmp_path / "a.png", "--frame", "1") == 0
    assert render(scene_file, tmp_path / "b.png", "--frame", "1", "--lens", "pinhole") == 0
    assert "ray" not in said(capsys)
    flags = ("--shutter", "top-to-bottom", "--readout", "0", "--aperture-radius", "0")
    assert render(scene_file, tmp_path / "c.png", "--frame", "1", *flags) == 0
    assert "no effect of the camera shows" in said(capsys)
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()
    torch.testing.assert_close(
        png_rgb(tmp_path / "c.png"), png_rgb(tmp_path / "a.png"), atol=1.01 / 255, rtol=0
    )


def test_double_precision_is_the_reference_and_nothing_else(
    scene_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    assert render(scene_file, tmp_path / "a.exr") == 0
    assert render(scene_file, tmp_path / "b.exr", "--dtype", "float64") == 0
    single, double = (read_depth_exr(tmp_path / f"{name}.exr")[0] for name in "ab")
    torch.testing.assert_close(single, double, equal_nan=True, atol=1e-4, rtol=1e-5)
    assert not torch.equal(single.nan_to_num(), double.nan_to_num())  # another renderer
    for flags in (("--f-stop", "2"), ("--budget", "10s"), ("--dataset",), ("--device", "auto")):
        assert render(scene_file, tmp_path / "c.png", "--dtype", "float64", *flags) == 2
        assert "--dtype float64: expected a pinhole camera on the CPU" in said(capsys)


def test_an_image_is_what_the_library_takes(
    scene_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    flags = ["--lens", "fisheye", "--fov", "120", "--aperture-radius", "0.1", "--samples", "4"]
    flags += ["--shutter", "left-to-right", "--readout", "0.05", "--exposure", "0.04"]
    assert render(scene_file, tmp_path / "a.png", *flags, "--frame", "1", "--seed", "9") == 0
    text = said(capsys)
    assert "4 rays per pixel; time split into" in text
    assert "the depth in the middle of frame 0" in text
    assert "the lens sees nothing in" in text
    scene = load_scene(scene_file)
    options = OpticsOptions(
        lens="fisheye",
        fov=120.0,
        aperture_radius=0.1,
        samples=4,
        shutter="left-to-right",
        readout=0.05,
        exposure=0.04,
        seed=9,
    )
    filmed, _ = choose_optics(scene, scene.path, options)
    settings = to_photo_settings(options)
    photo = photograph(scene, filmed.camera(1), filmed.time_s(1), settings=settings)
    write_png(photo.rgb, tmp_path / "b.png")
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


def test_time_stops_the_scene_but_not_the_camera(
    scene_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    blur = ("--exposure", "0.1", "--frame", "1")
    assert render(scene_file, tmp_path / "moving.png", *blur) == 0
    assert render(scene_file, tmp_path / "camera.png", *blur, "--time", "0.1") == 0
    assert "16 rays per pixel" in said(capsys)
    assert render(scene_file, tmp_path / "still.png", "--time", "0.1", "--frame", "1") == 0
    images = {file.read_bytes() for file in tmp_path.glob("*.png")}
    assert len(images) == 3


def test_a_camera_that_stands_needs_no_rays_for_its_shutter(
    scene_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    flags = ("--camera", "static", "--time", "0.1", "--exposure", "0.01")
    assert render(scene_file, tmp_path / "a.png", *flags) == 0
    text = said(capsys)
    assert "left out: exposure: neither scene nor camera moves meanwhile" in text


def test_depth_and_distance(
    scene_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    assert render(scene_file, tmp_path / "a.exr", "--lens", "opencv") == 0
    depth, path = read_depth_exr(tmp_path / "a.exr")
    assert depth.shape == (3, 10, 12)
    assert len(path) == 3
    assert "distance along" not in said(capsys)
    assert render(scene_file, tmp_path / "b.exr", "--lens", "equirectangular") == 0
    assert "distance along the ray, not z-depth" in said(capsys)
    distance, _ = read_depth_exr(tmp_path / "b.exr", "distance")
    assert distance.shape == (3, 6, 12)
    with OpenEXR.File(str(tmp_path / "b.exr"), separate_channels=True) as opened:
        assert "equirectangular" in opened.parts[0].header["optics"]


def test_a_video_through_a_lens(scene_file: Path, tmp_path: Path) -> None:
    assert render(scene_file, tmp_path / "a.mp4", "--lens", "blender", "--fov", "90") == 0
    assert (tmp_path / "a.mp4").stat().st_size > 0


def test_a_data_set_is_written_whole_and_once(
    scene_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    out = tmp_path / "set"
    assert render(scene_file, out, "--dataset", "--samples", "2", "--f-stop", "8") == 0
    text = said(capsys)
    assert "f/8 is a radius of" in text
    assert "combined: 2 rays per pixel" in text
    assert set(EFFECTS) < {path.name for path in out.iterdir()}
    own = read_camera_record(out / "combined" / "camera.json")
    optics = own.physical_path.optics
    assert optics.exposure_s == pytest.approx(0.05)
    assert optics.shutter.readout_s == pytest.approx(0.05)
    assert optics.aperture.focus_distance == pytest.approx(WALL_DEPTH, abs=0.3)
    assert render(scene_file, out, "--dataset") == 2
    assert "expected a new or empty folder" in said(capsys)
    assert render(scene_file, tmp_path / "set.mp4", "--dataset") == 2
    assert "--dataset: expected a folder as --out" in said(capsys)


@pytest.mark.parametrize(
    ("flags", "says"),
    [
        (("--readout", "0.01"), "--readout: expected together with --shutter"),
        (("--shutter", "top-to-bottom"), "--shutter top-to-bottom: expected with --readout"),
        (("--lens-coefficients", "1", "2"), "--lens-coefficients: expected with --lens"),
        (
            ("--lens", "fisheye", "--lens-coefficients", "-0.1", "0"),
            "--lens-coefficients: expected 4 numbers for fisheye, got 2",
        ),
        (("--lens", "opencv", "--lens-coefficients", "1"), "expected 4 or 5 or 8 or 12 numbers"),
        (("--lens", "fisheye", "--f-stop", "2"), "--f-stop: expected a lens with a focal length"),
        (("--f-stop", "2", "--aperture-radius", "0.1"), "expected one of them, got both"),
        (("--focus-distance", "2"), "--focus-distance: expected together with --f-stop or"),
        (("--focus-surface", "sphere"), "--focus-surface: expected together with --f-stop or"),
        (("--sensor-size", "20"), "--sensor-size: expected together with --f-stop or --lens"),
        (("--metres-per-unit", "2"), "--metres-per-unit: expected together with --f-stop"),
        (("--fov", "90"), "--fov: expected together with --lens fisheye or blender"),
        (("--samples", "4"), "--samples: expected together with"),
        (("--seed", "4"), "--seed: expected together with"),
        (("--rows-per-chunk", "4"), "--rows-per-chunk: expected together with --shutter or"),
        (("--tolerance-px", "1"), "--tolerance-px: expected together with --shutter or"),
        (("--f-stop", "0"), "--f-stop: expected a finite number above 0, got 0"),
        (("--aperture-radius", "-1"), "--aperture-radius: expected a finite number of at least 0"),
        (("--exposure", "nan"), "--exposure: expected a finite number of at least 0, got nan"),
        (("--exposure", "0.2"), "expected read-out and exposure of at most 0.1 s together"),
        (("--samples", "0", "--pixel-area"), "--samples: expected a finite number of at least 1"),
        (("--samples", "1000000", "--pixel-area"), "samples: expected 1 to 65536"),
        (("--lens", "fisheye", "--fov", "400"), "--fov: expected at most 360 degrees, got 400"),
        (
            ("--lens", "fisheye", "--lens-coefficients", "-9", "0", "0", "0", "--fov", "90"),
            "--fov: expected at most 22.05 degrees",
        ),
        (("--lens", "fisheye", "--out", "x.avi"), "--out: expected a name ending in .mp4"),
        (("--lens", "fisheye", "--frame", "9"), "--frame: expected -3 to 2, got 9"),
        (("--dataset", "--lens", "opencv"), "--dataset: expected --lens fisheye or blender"),
        (("--dataset", "--frame", "1"), "--frame: expected without --dataset"),
        (("--dataset", "--readout", "0.09"), "combined: expected read-out and exposure of"),
        (("--dataset", "--metres-per-unit", "2"), "--metres-per-unit: expected together with"),
        (("--dataset", "--sensor-size", "2"), "--sensor-size: expected together with"),
        (("--dataset", "--exposure", "-2"), "--exposure: expected a finite number of at least 0"),
    ],
)
def test_options_that_need_others_are_refused_in_one_line(
    scene_file: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture,
    flags: tuple[str, ...],
    says: str,
) -> None:
    out = tmp_path / ("set" if "--dataset" in flags else "a.png")
    assert render(scene_file, out, *flags) == 2
    lines = [line for line in said(capsys).splitlines() if line.startswith("diff4splat:")]
    assert len(lines) == 1
    assert says in lines[0]
    assert not out.exists()


def test_an_f_stop_is_the_focal_length_over_two_n() -> None:
    path = filmed_scene().path  # 9.6 px of 12: a focal length of 0.8 sensors
    for sensor_mm, metres, want in ((None, None, 0.0288 / 4), (24.0, 0.1, 0.192 / 4)):
        options = OpticsOptions(f_stop=2.0, sensor_size=sensor_mm, metres_per_unit=metres)
        assert f_stop_radius(options, path) == pytest.approx(want)


def test_the_focus_is_what_the_middle_of_the_first_frame_shows() -> None:
    scene = filmed_scene(size_px=(40, 48))
    focus = central_focus(scene, scene.path)
    assert focus.distance == pytest.approx(DOT_DEPTH, abs=0.05)
    empty = scene.select(torch.arange(len(scene.gaussians)) < 1)
    fallback = central_focus(empty, scene.path)
    assert "shows nothing in its middle" in fallback.note
    assert fallback.distance > 0


def test_coefficients_go_where_opencv_has_them() -> None:
    twelve = tuple(float(value) / 100 for value in range(1, 13))
    options = OpticsOptions(lens="opencv", lens_coefficients=twelve)
    lens, path = build_lens(options, filmed_scene().path)
    assert lens.radial.tolist() == [0.01, 0.02, 0.05, 0.06, 0.07, 0.08]
    assert lens.tangential.tolist() == [0.03, 0.04]
    assert lens.thin_prism.tolist() == [0.09, 0.1, 0.11, 0.12]
    assert path is not None


def test_coefficients_of_cycles_are_known_by_their_sign() -> None:
    path = filmed_scene().path
    for sign in (1.0, -1.0):
        options = OpticsOptions(
            lens="blender", lens_coefficients=(0.0, sign * 0.02, 0.0, 0.0, 0.0), sensor_size=24.0
        )
        lens, bent = build_lens(options, path)
        assert lens.cycles_signs == (sign < 0)
        assert bent.cameras.focal_px[0].tolist() == [0.5, 0.5]


def test_a_single_frame_has_time_for_everything() -> None:
    scene = filmed_scene(1)
    sequences, notes = choose_effects(scene, scene.path, OpticsOptions())
    assert sequences["combined"].optics.exposure_s == pytest.approx(1 / 48)
    assert any("aperture: a radius of" in note for note in notes)
    made, _ = choose_optics(scene, scene.path, OpticsOptions(exposure=5.0))
    assert made.optics.exposure_s == 5.0
    with pytest.raises(InputError, match=r"most 0\.1 s together"):
        choose_optics(filmed_scene(2), filmed_scene(2).path, OpticsOptions(exposure=5.0))


def test_defaults_are_consistent_and_finite_numbers_are_asked_for() -> None:
    require_consistent(OpticsOptions())
    with pytest.raises(ConfigError, match="expected finite numbers"):
        require_consistent(OpticsOptions(lens="fisheye", lens_coefficients=(np.inf, 0.0, 0.0, 0.0)))
