"""Frames of fisheyes and whole spheres, read as they are: COLMAP's models and nerfstudio's."""

import math
import struct
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
import pytest
import torch
from capture_checks import assert_pose
from capture_folders import Seer, change_json, rig_cameras, seer, write_image, write_json
from colmap_folders import cloud, write_binary, write_text
from oracles_physical import dots
from torch import Tensor

from diff4splat.data.capture.capture import Capture
from diff4splat.data_prep.readers.options import ReadOptions
from diff4splat.data_prep.readers.registry import read_capture
from diff4splat.errors import FileFormatError
from diff4splat.geometry.camera import Camera
from diff4splat.geometry.lenses.equirectangular import Equirectangular
from diff4splat.geometry.lenses.opencv_fisheye import OpenCVFisheye
from diff4splat.geometry.lenses.protocol import Lens
from diff4splat.geometry.lenses.sensor import sensor_pixels
from diff4splat.geometry.optics import Optics
from diff4splat.geometry.physical_camera import PhysicalCamera
from diff4splat.render.physical.api import photograph

SIZE = (12, 18)
WIDE = {"focal_px": (6.0, 5.5), "center_px": (9.3, 5.8), "size_px": SIZE}
ROUND = {"focal_px": (6.0, 6.0), "center_px": (9.3, 5.8), "size_px": SIZE}
FOUR = (-0.06, 0.02, -0.005, 0.001)
NUMBERS = {"SIMPLE_RADIAL_FISHEYE": 8, "RADIAL_FISHEYE": 9, "OPENCV_FISHEYE": 5, "PINHOLE": 1}
DOTS = dots([(0.0, 0.0, 0.0), (1.5, 0.3, 0.2), (-2.5, 0.4, -1.0), (0.3, -0.9, 0.8)], scale=0.5)
AHEAD = np.array([(0.1, 0.2, 1.0), (1.3, -0.4, 0.9), (-2.0, 0.3, 0.5), (0.0, 0.0, 1.0)])


def fisheye(coefficients: Sequence[float] = FOUR) -> OpenCVFisheye:
    return OpenCVFisheye(coefficients=torch.tensor(coefficients, dtype=torch.float64))


def image(camera: Seer, lens: Lens, focal_px: tuple[float, float] | None = None) -> np.ndarray:
    """8-bit RGB of the dots, through ``lens``."""
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = camera.rows().T, camera.position
    own = Camera(
        focal_px=torch.tensor(focal_px or camera.focal_px, dtype=torch.float64),
        center_px=torch.tensor(camera.center_px, dtype=torch.float64),
        world_from_camera=torch.from_numpy(pose),
        size_px=camera.size_px,
    )
    made = photograph(DOTS, PhysicalCamera(camera=own, optics=Optics(lens=lens)))
    return np.round(255 * made.rgb.numpy()).astype(np.uint8)


def assert_renders(capture: Capture, index: int) -> None:
    """What the capture's own camera shows is the image in the file, and not an empty one."""
    made, read = photograph(DOTS, capture.physical_camera(index)).rgb, capture.frames.read(index)
    torch.testing.assert_close(made, read.rgb, atol=0.51 / 255, rtol=0)
    assert float(read.rgb.max()) > 0.3
    assert read.counts is None


def numbers(camera: Seer, model: str, four: Sequence[float]) -> list[float]:
    """As COLMAP lists them."""
    (fx, fy), bent = camera.focal_px, list(four)
    focal = [fx, fy] if model in ("PINHOLE", "OPENCV_FISHEYE") else [fx]
    count = {"SIMPLE_RADIAL_FISHEYE": 1, "RADIAL_FISHEYE": 2, "PINHOLE": 0}.get(model, 4)
    return [*focal, *camera.center_px, *bent[:count]]


def write_cameras(folder: Path, cameras: Sequence[tuple[str, list[float]]], text: bool) -> None:
    """A camera per image, of the model and with the numbers given."""
    height, width = SIZE
    rows = list(enumerate(cameras, start=1))
    if text:
        lines = [f"{i} {m} {width} {height} {' '.join(map(repr, v))}" for i, (m, v) in rows]
        (folder / "cameras.txt").write_text("\n".join(lines) + "\n")
        return
    packed = [struct.pack("<Q", len(rows))]
    for number, (model, values) in rows:
        packed.append(struct.pack("<iiQQ", number, NUMBERS[model], width, height))
        packed.append(struct.pack(f"<{len(values)}d", *values))
    (folder / "cameras.bin").write_bytes(b"".join(packed))


def write_colmap(folder: Path, model: str, four: Sequence[float], text: bool) -> list[Seer]:
    """Three places of one camera; the model lies in sparse/0."""
    cameras = [
        seer(0.3 * index, **(WIDE if model == "OPENCV_FISHEYE" else ROUND)) for index in range(3)
    ]
    for index, camera in enumerate(cameras):
        write_image(folder / "images" / f"{index}.png", image(camera, fisheye(four)))
    named = [(f"{index}.png", camera) for index, camera in enumerate(cameras)]
    (write_text if text else write_binary)(folder / "sparse" / "0", named, cloud())
    lenses = [(model, numbers(camera, model, four)) for camera in cameras]
    write_cameras(folder / "sparse" / "0", lenses, text)
    return cameras


def write_nerfstudio(folder: Path, four: Sequence[float] = FOUR, **more: object) -> list[Seer]:
    """Three places of one camera, ``k1`` to ``k4`` for all frames."""
    cameras, frames = [seer(0.3 * index, **WIDE) for index in range(3)], []
    for index, camera in enumerate(cameras):
        name = f"images/{index}.png"
        write_image(folder / name, image(camera, fisheye(four)))
        frames.append({"file_path": name, "transform_matrix": camera.opengl(), "time": index / 10})
    named = dict(zip(("k1", "k2", "k3", "k4"), four, strict=True))
    focal = {"fl_x": 6.0, "fl_y": 5.5, "cx": 9.3, "cy": 5.8, "w": 18, "h": 12}
    root = {"camera_model": "OPENCV_FISHEYE", **focal, **named, **more, "frames": frames}
    write_json(folder / "transforms.json", root)
    return cameras


def pixels(capture: Capture, directions: np.ndarray) -> Tensor:
    """Where the first camera sees directions in its own axes."""
    found, exists = sensor_pixels(
        capture.cameras[0], capture.optics.lens, torch.from_numpy(directions)
    )
    assert bool(exists.all())
    return found


@pytest.mark.parametrize(
    ("model", "four"),
    [
        ("SIMPLE_RADIAL_FISHEYE", (-0.05, 0.0, 0.0, 0.0)),
        ("RADIAL_FISHEYE", (-0.05, 0.01, 0.0, 0.0)),
        ("OPENCV_FISHEYE", FOUR),
    ],
)
@pytest.mark.parametrize("text", [False, True])
def test_fisheye_models_of_colmap_are_seen_through(
    tmp_path: Path, model: str, four: tuple[float, ...], text: bool
) -> None:
    cameras = write_colmap(tmp_path, model, four, text)
    capture = read_capture(tmp_path)
    assert capture.optics.lens.coefficients.tolist() == list(four)
    assert capture.cameras.focal_px[0].tolist() == list(cameras[0].focal_px)
    assert capture.tracks == {}
    for index, camera in enumerate(cameras):
        assert_pose(capture, index, camera)
        assert_renders(capture, index)
    assert any("left as their fisheye lens shows them" in note for note in capture.notes)
    assert not any("distortion was removed" in note for note in capture.notes)


def test_fisheyes_project_as_those_of_opencv(tmp_path: Path) -> None:
    camera = write_colmap(tmp_path, "OPENCV_FISHEYE", FOUR, text=True)[0]
    matrix = np.array([[6.0, 0, camera.center_px[0]], [0, 5.5, camera.center_px[1]], [0, 0, 1]])
    turned = np.zeros(3)
    want, _ = cv2.fisheye.projectPoints(AHEAD[:, None], turned, turned, matrix, np.array(FOUR))
    got = pixels(read_capture(tmp_path), AHEAD)
    np.testing.assert_allclose(got.numpy(), want[:, 0], atol=1e-9)


@pytest.mark.parametrize("per_frame", [False, True])
def test_fisheye_frames_of_nerfstudio_are_seen_through(tmp_path: Path, per_frame: bool) -> None:
    cameras = write_nerfstudio(tmp_path)

    def into_frames(root: dict) -> None:
        for key in ("camera_model", "k1", "k2", "k3", "k4", "fl_x"):
            value = root.pop(key)
            for frame in root["frames"]:
                frame[key] = value

    if per_frame:
        change_json(tmp_path / "transforms.json", into_frames)
    capture = read_capture(tmp_path)
    assert capture.optics.lens.coefficients.tolist() == list(FOUR)
    assert capture.cameras.focal_px.tolist() == [[6.0, 5.5]] * 3
    for index, camera in enumerate(cameras):
        assert_pose(capture, index, camera)
        assert_renders(capture, index)
    assert any("left as their fisheye lens shows them" in note for note in capture.notes)


def test_instant_ngp_calls_the_same_a_fisheye(tmp_path: Path) -> None:
    write_nerfstudio(tmp_path, is_fisheye=True)
    change_json(tmp_path / "transforms.json", lambda root: root.pop("camera_model"))
    capture = read_capture(tmp_path)
    assert capture.optics.lens.coefficients.tolist() == list(FOUR)
    assert_renders(capture, 1)


def test_focal_lengths_are_of_each_frame_and_the_lens_of_all(tmp_path: Path) -> None:
    cameras = write_nerfstudio(tmp_path)
    change_json(tmp_path / "transforms.json", lambda root: root["frames"][2].update(fl_x=4.0))
    write_image(tmp_path / "images/2.png", image(cameras[2], fisheye(), (4.0, 5.5)))
    capture = read_capture(tmp_path)
    assert capture.cameras.focal_px[:, 0].tolist() == [6.0, 6.0, 4.0]
    assert_renders(capture, 1)
    assert_renders(capture, 2)


def test_smaller_images_are_seen_through_the_same_lens(tmp_path: Path) -> None:
    write_nerfstudio(tmp_path)
    fine, coarse = read_capture(tmp_path), read_capture(tmp_path, ReadOptions(downscale=2))
    assert coarse.cameras.size_px == (6, 9)
    assert torch.equal(coarse.optics.lens.coefficients, fine.optics.lens.coefficients)
    torch.testing.assert_close(2 * pixels(coarse, AHEAD), pixels(fine, AHEAD))
    for index in range(3):
        small = cv2.resize(cv2.imread(str(tmp_path / f"images/{index}.png")), (9, 6))
        cv2.imwrite(str(tmp_path / f"images/{index}.png"), small)
    torch.testing.assert_close(pixels(read_capture(tmp_path), AHEAD), pixels(coarse, AHEAD))


@pytest.mark.parametrize("focal", [{}, {"fl_x": 9.0, "fl_y": 12.0, "cx": 9.0, "cy": 6.0}])
def test_whole_spheres_are_seen_around(tmp_path: Path, focal: dict) -> None:
    cameras = [seer(0.3 * index, size_px=SIZE, center_px=(9.0, 6.0)) for index in range(3)]
    frames = []
    for index, camera in enumerate(cameras):
        per_radian = (9.0 / math.pi, 12.0 / math.pi)
        name = f"{index}.png"
        write_image(tmp_path / name, image(camera, Equirectangular(), per_radian))
        frames.append({"file_path": name, "transform_matrix": camera.opengl(), "time": index / 10})
    root = {"camera_model": "EQUIRECTANGULAR", **focal, "frames": frames}
    write_json(tmp_path / "transforms.json", root)
    capture = read_capture(tmp_path)
    assert isinstance(capture.optics.lens, Equirectangular)
    for index, camera in enumerate(cameras):
        assert_pose(capture, index, camera)
        assert_renders(capture, index)
    assert any("the whole sphere" in note for note in capture.notes)
    x, y, z = around = np.array([(0.3, 0.4, 1.0), (-1.0, 0.1, -0.5), (0.0, -2.0, 0.1)]).T
    longitude, latitude = np.arctan2(x, z), np.arcsin(y / np.linalg.norm(around, axis=0))
    want = np.stack([9 * longitude / np.pi + 9, 12 * latitude / np.pi + 6], -1)
    np.testing.assert_allclose(pixels(capture, around.T.copy()).numpy(), want, atol=1e-9)
    coarse = read_capture(tmp_path, ReadOptions(downscale=3))
    assert coarse.cameras.focal_px[0].tolist() == pytest.approx([3 / math.pi, 4 / math.pi])


def test_distances_beside_fisheye_frames_are_not_taken_for_depth(tmp_path: Path) -> None:
    write_nerfstudio(tmp_path)
    np.save(tmp_path / "d.npy", np.ones(SIZE, np.float32))
    change_json(
        tmp_path / "transforms.json", lambda root: root["frames"][0].update(depth_file_path="d.npy")
    )
    capture = read_capture(tmp_path)
    assert capture.frames.read(0).depth is None
    assert "distances were left out: depth is z" in capture.notes


def test_masks_cover_fisheye_frames(tmp_path: Path) -> None:
    write_nerfstudio(tmp_path)
    mask = np.full((*SIZE, 3), 255, np.uint8)
    mask[:, :4] = 0
    write_image(tmp_path / "mask.png", mask)
    change_json(
        tmp_path / "transforms.json", lambda root: root["frames"][1].update(mask_path="mask.png")
    )
    counts = read_capture(tmp_path).frames.read(1).counts
    assert torch.equal(counts, torch.from_numpy(mask[..., 0] > 0))


def test_cameras_with_other_coefficients_are_refused_by_name(tmp_path: Path) -> None:
    write_nerfstudio(tmp_path)
    change_json(tmp_path / "transforms.json", lambda root: root["frames"][2].update(k3=0.25))
    says = r"2\.png: expected the fisheye coefficients of .*0\.png, .*got \(.* 0\.25, .*calibrate"
    with pytest.raises(FileFormatError, match=says):
        read_capture(tmp_path)


@pytest.mark.parametrize("text", [False, True])
def test_a_rig_shares_one_lens(tmp_path: Path, text: bool) -> None:
    cameras = rig_cameras(3, **WIDE)
    for number, camera in enumerate(cameras, start=1):
        file = tmp_path / f"cam0{number}" / "frame_00001.png"
        write_image(file, image(camera, fisheye()))
    named = [(f"image{number}.jpg", camera) for number, camera in enumerate(cameras, start=1)]
    (write_text if text else write_binary)(tmp_path / "sparse_", named, cloud())
    lenses = [("OPENCV_FISHEYE", numbers(camera, "OPENCV_FISHEYE", FOUR)) for camera in cameras]
    write_cameras(tmp_path / "sparse_", lenses, text)
    capture = read_capture(tmp_path)
    for index, camera in enumerate(cameras):
        assert_pose(capture, index, camera)
        assert_renders(capture, index)
    lenses[1] = ("PINHOLE", numbers(cameras[1], "PINHOLE", FOUR))
    write_cameras(tmp_path / "sparse_", lenses, text)
    says = r"cam02/frame_00001\.png: expected a fisheye camera as for .*cam01/.*got a pinhole one"
    with pytest.raises(FileFormatError, match=says):
        read_capture(tmp_path)
    lenses[1] = ("OPENCV_FISHEYE", numbers(cameras[1], "OPENCV_FISHEYE", (-3.0, 0, 0, 0)))
    write_cameras(tmp_path / "sparse_", lenses, text)
    with pytest.raises(FileFormatError, match=r"sparse_: cam02: expected fisheye coefficients"):
        read_capture(tmp_path)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"k1": -3.0, "k2": 0.0}, r"transforms\.json: frame 0: .* \(-3, 0, .*turn back 1\.\d+ pix"),
        ({"k4": -1e300}, "frame 0: expected fisheye coefficients that rise"),
        ({"k2": float("nan")}, "'k2': expected a finite number"),
        ({"k2": "0.1"}, "'k2': expected a number, got the text"),
        ({"p1": 0.1}, "expected no lens distortion, got p1 = 0.1"),
        ({"k5": 0.1}, "expected no lens distortion, got k5 = 0.1"),
        ({"fl_x": None, "fl_y": None, "camera_angle_x": 2.0}, r"a focal length \(fl_x, fl_y\), go"),
        ({"camera_model": "EQUIRECTANGULAR", "fl_x": 1.0}, "'fl_x': expected 9, since an image"),
        ({"camera_model": "OPENCV"}, "expected no lens distortion, got k4 = 0.001"),
        ({"camera_model": 3}, "expected a pinhole camera_model"),
    ],
)
def test_lenses_that_make_no_sense_are_refused(tmp_path: Path, change: dict, says: str) -> None:
    write_nerfstudio(tmp_path)
    change_json(tmp_path / "transforms.json", lambda root: root.update(change))
    with pytest.raises(FileFormatError, match=says) as caught:
        read_capture(tmp_path)
    assert "\n" not in str(caught.value)


def test_spheres_with_coefficients_of_a_fisheye_are_refused(tmp_path: Path) -> None:
    write_nerfstudio(tmp_path, camera_model="EQUIRECTANGULAR", fl_x=9.0, fl_y=12.0, cx=9.0, cy=6.0)
    with pytest.raises(FileFormatError, match="expected no lens distortion, got k1"):
        read_capture(tmp_path)
