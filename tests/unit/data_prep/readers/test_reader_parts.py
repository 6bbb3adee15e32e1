"""Small pieces of the readers: lenses, layers, names, numbers of cameras, stores."""

import math
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import torch
from capture_folders import rig_cameras, seer, write_image
from hypothesis import given, settings
from hypothesis import strategies as st

from diff4splat.data_prep.readers.common.camera_ids import assign_camera_ids
from diff4splat.data_prep.readers.common.intrinsics import Intrinsics, distort, undistortion_map
from diff4splat.data_prep.readers.files import pixel_layers
from diff4splat.data_prep.readers.files.depth_file import grey_levels
from diff4splat.data_prep.readers.files.file_discovery import (
    find_image,
    last_number,
    natural_key,
    resolve_inside,
)
from diff4splat.data_prep.readers.files.float_files import exr_channels
from diff4splat.data_prep.readers.files.image_file import ImageFile, Pixels
from diff4splat.data_prep.readers.files.lru_cache import LruCache
from diff4splat.data_prep.readers.files.pixel_layers import PixelLayers
from diff4splat.data_prep.readers.files.point_cloud import cloud_from_arrays, read_cloud
from diff4splat.errors import FileFormatError

small = st.floats(-0.2, 0.2)


@settings(max_examples=25, deadline=None)
@given(
    radial=st.tuples(small, small, small), tangential=st.tuples(small, small), seed=st.integers()
)
def test_a_lens_bends_as_opencv_says(radial, tangential, seed) -> None:
    lens = Intrinsics(
        focal_px=(50.0, 55.0),
        center_px=(31.0, 17.0),
        size_px=(40, 60),
        radial=radial,
        tangential=tangential,
    )
    xy = np.random.default_rng(abs(seed)).uniform(-0.7, 0.7, (9, 2))
    points = np.concatenate([xy, np.ones((9, 1))], 1)
    matrix = np.array([[50.0, 0, 31], [0, 55, 17], [0, 0, 1]])
    bends = np.array([*radial[:2], *tangential, radial[2]])
    want = cv2.projectPoints(points, np.zeros(3), np.zeros(3), matrix, bends)[0][:, 0]
    np.testing.assert_allclose(np.stack(distort(lens, *xy.T), -1), want, atol=1e-9)


def test_a_lens_may_be_skewed() -> None:
    camera = seer(0.3, skew_px=5.0, radial=(-0.3, 0.1, 0.05), tangential=(0.03, -0.02))
    lens = Intrinsics(
        focal_px=camera.focal_px,
        center_px=camera.center_px,
        size_px=camera.size_px,
        skew_px=5.0,
        radial=camera.radial,
        tangential=camera.tangential,
    )
    for point in np.random.default_rng(0).uniform(-1, 1, (9, 3)):
        x, y, z = camera.rows() @ (point - camera.position)
        got = distort(lens, np.array([x / z]), np.array([y / z]))
        np.testing.assert_allclose(np.concatenate(got), camera.seen_px(point), atol=1e-12)


def test_a_straight_lens_takes_every_pixel_from_where_it_is() -> None:
    lens = Intrinsics(focal_px=(50.0, 55.0), center_px=(31.0, 17.0), size_px=(40, 60))
    column, row = undistortion_map(lens)
    np.testing.assert_allclose(column[7], np.arange(60), atol=1e-4)
    np.testing.assert_allclose(row[:, 7], np.arange(40), atol=1e-4)


def test_where_a_lens_folds_back_nothing_is_found() -> None:
    lens = Intrinsics(
        focal_px=(20.0, 20.0), center_px=(30.0, 20.0), size_px=(40, 60), radial=(-0.4, 0.0, 0.0)
    )
    column, _ = undistortion_map(lens)
    turning = 20 * math.sqrt(1 / 1.2)
    inside_px = np.hypot(*np.meshgrid(np.arange(60) - 29.5, np.arange(40) - 19.5)) < turning
    assert np.array_equal(column > -1.5, inside_px)


def test_a_lens_follows_its_image() -> None:
    lens = Intrinsics(focal_px=(50.0, 55.0), center_px=(31.0, 17.0), size_px=(40, 60), skew_px=2.0)
    half = lens.downscaled(2)
    assert (half.focal_px, half.center_px, half.size_px) == ((25, 27.5), (15.5, 8.5), (20, 30))
    assert half.skew_px == 1
    assert lens.scaled_to((20, 30), "x") == half
    assert lens.scaled_to((40, 60), "x") == lens
    assert lens.is_distorted
    assert not replace(lens, model="fisheye").is_distorted
    with pytest.raises(FileFormatError, match="x: expected an image shaped as its camera, 60 x 40"):
        lens.scaled_to((40, 50), "x")


def test_a_block_counts_when_all_of_it_does_and_its_depth_is_one_of_its_depths() -> None:
    rgb = np.arange(4 * 6 * 3, dtype=np.float32).reshape(4, 6, 3)
    counts = np.ones((4, 6), bool)
    counts[0, 0] = False
    depth = np.array([[0, 2, 5, 5, 0, 0], [8, 4, 5, 9, 0, 0]] * 2, np.float32)
    got = pixel_layers.downscale(PixelLayers(rgb=rgb, counts=counts, depth=depth), 2)
    np.testing.assert_allclose(got.rgb[0, 0], rgb[:2, :2].mean((0, 1)))
    assert got.counts.tolist() == [[False, True, True], [True] * 3]
    assert got.depth.tolist() == [[4, 5, 0], [4, 5, 0]]


def test_straightening_keeps_depth_of_one_side() -> None:
    depth = np.where(np.arange(8) < 4, 1, 9).astype(np.float32)[None].repeat(4, 0)
    column, row = np.meshgrid(np.arange(8, dtype=np.float32) + 0.3, np.arange(4, dtype=np.float32))
    rgb = np.zeros((4, 8, 3), np.float32)
    got = pixel_layers.undistort(PixelLayers(rgb=rgb, depth=depth), column, row)
    assert set(np.unique(got.depth)) <= {0, 1, 9}
    assert got.counts[:, :-1].all()
    assert not got.counts[:, -1].any()


def test_nan_in_transparency_does_not_count() -> None:
    rgb, alpha = np.full((1, 3, 3), 0.5, np.float32), np.array([[1, 0, np.nan]], np.float32)
    got = pixel_layers.composite_over(Pixels(rgb=rgb, alpha=alpha), (1.0, 1.0, 1.0))
    assert got.counts.tolist() == [[True, True, False]]
    assert got.rgb[0, :, 0].tolist() == [0.5, 1, 1]


@pytest.mark.parametrize(
    "name", ["../a.png", "/a.png", "b/../../a.png", "..", "", "a\0.png", "..\\a.png"]
)
def test_names_that_leave_the_folder_are_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(FileFormatError, match="here: expected a path inside"):
        resolve_inside(tmp_path, name, "here")


@pytest.mark.parametrize("name", ["a.png", "./b/a.png", "b/../a.png", "...png", "b\\a.png"])
def test_names_that_stay_are_taken(tmp_path: Path, name: str) -> None:
    assert resolve_inside(tmp_path, name, "here").resolve().is_relative_to(tmp_path.resolve())


def test_a_suffix_may_be_left_away(tmp_path: Path) -> None:
    write_image(tmp_path / "r_0.1.png", np.zeros((2, 2, 3), np.uint8))
    assert find_image(tmp_path, "./r_0.1", "x") == tmp_path / "r_0.1.png"
    assert find_image(tmp_path, "r_0.1.png", "x") == tmp_path / "r_0.1.png"


def test_numbers_in_names_sort_as_numbers() -> None:
    names = ["frame_10.png", "frame_9.png", "frame_009b.png", "a.png"]
    assert sorted(names, key=natural_key) == ["a.png", names[2], names[1], names[0]]
    assert last_number("cam01/take2_frame_00012.jpg") == 12
    assert last_number("first.jpg") is None


def poses(*angles: float) -> torch.Tensor:
    return torch.tensor(np.array([seer(angle).opengl() for angle in angles]))


def test_cameras_are_told_apart_by_what_comes_back() -> None:
    assert assign_camera_ids(poses(0.2, 0.1, 0.2, 0.1), [0.0, 0.0, 1.0, 1.0]) == [0, 1, 0, 1]
    assert assign_camera_ids(poses(0.1, 0.2, 0.3, 0.4), [0.0, 1.0, 2.0, 3.0]) == [0, 0, 0, 0]
    assert assign_camera_ids(poses(0.1, 0.2, 0.3, 0.4), [0.0, 0.0, 1.0, 1.0]) == [0, 1, 0, 1]
    # The same place at the same time is no second image of one camera.
    assert assign_camera_ids(poses(0.1, 0.1, 0.2, 0.2), [0.0, 0.0, 1.0, 1.0]) == [0, 1, 0, 1]


def test_a_store_forgets_what_was_not_used_for_longest() -> None:
    store = LruCache(30)
    for key in "abc":
        store.put(key, (np.zeros(10, np.uint8),))
    assert store.get("a") is not None
    store.put("d", (np.zeros(10, np.uint8),))
    assert [store.get(key) is None for key in "abcd"] == [False, True, False, False]
    store.put("a", (np.zeros(25, np.uint8),))
    assert [store.get(key) is None for key in "abcd"] == [False, True, True, True]
    store.put("e", (np.zeros(31, np.uint8),))
    assert store.get("e") is None


@pytest.mark.parametrize("channels", [1, 3, 4])
def test_grey_and_palette_images_are_images(tmp_path: Path, channels: int) -> None:
    levels = np.full((5, 7, channels), 51, np.uint8)
    cv2.imwrite(str(tmp_path / "a.png"), levels)
    image = ImageFile(file=tmp_path / "a.png")
    assert (image.size_px(), image.has_alpha()) == ((5, 7), channels == 4)
    np.testing.assert_allclose(image.read().rgb, 0.2, atol=1e-7)


@pytest.mark.parametrize(
    ("array", "message"),
    [
        (np.zeros((4, 4)), "expected height x width x 3"),
        (np.zeros((4, 4, 2)), "expected height x width x 3"),
        (np.zeros((4, 4, 3), np.int64), "or whole numbers of 8 or 16 bits, got int64"),
        (np.zeros((4, 4, 3), complex), "expected the header of an array of numbers"),
    ],
)
def test_arrays_that_are_no_images_are_refused(tmp_path: Path, array, message: str) -> None:
    np.save(tmp_path / "a.npy", array)
    with pytest.raises(FileFormatError, match=message):
        ImageFile(file=tmp_path / "a.npy").read()


def test_arrays_of_bytes_are_levels(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", np.full((2, 2, 4), 255, np.uint8))
    np.save(tmp_path / "b.npy", np.full((2, 2, 3), 65535, np.uint16))
    assert ImageFile(file=tmp_path / "a.npy").has_alpha()
    for name in ("a.npy", "b.npy"):
        assert float(ImageFile(file=tmp_path / name).read().rgb.min()) == 1


@pytest.mark.parametrize("read", [exr_channels, grey_levels, read_cloud])
def test_files_that_are_something_else_are_refused(tmp_path: Path, read) -> None:
    file = tmp_path / "a"
    file.write_bytes(b"something else entirely, and long enough to be a header")
    with pytest.raises(FileFormatError, match="a: expected"):
        read(file)
    with pytest.raises(FileFormatError, match="got no such file"):
        read(tmp_path / "b")


def test_a_cloud_without_positions_is_refused(tmp_path: Path) -> None:
    lines = ["ply", "format ascii 1.0", "element vertex 1", "property float x", "end_header", "1\n"]
    (tmp_path / "a.ply").write_text("\n".join(lines))
    with pytest.raises(FileFormatError, match="expected points with x, y and z, got"):
        read_cloud(tmp_path / "a.ply")


@pytest.mark.parametrize("kind", ["float", "uchar"])
def test_colours_of_points_are_bytes_or_shares(tmp_path: Path, kind: str) -> None:
    lines = ["ply", "format ascii 1.0", "element vertex 1"]
    lines += [f"property float {axis}" for axis in "xyz"]
    lines += [f"property {kind} {name}" for name in ("red", "green", "blue")]
    levels = "0.2 0.4 1" if kind == "float" else "51 102 255"
    (tmp_path / "a.ply").write_text("\n".join([*lines, "end_header", f"1 2 3 {levels}\n"]))
    cloud, notes = read_cloud(tmp_path / "a.ply")
    torch.testing.assert_close(cloud.rgb, torch.tensor([[0.2, 0.4, 1.0]]))
    assert notes == ()


def test_a_cloud_of_nothing_finite_is_none() -> None:
    cloud, notes = cloud_from_arrays(np.full((2, 3), np.inf), None, "x")
    assert cloud is None
    assert notes == (
        "x: 2 points that are not finite were dropped",
        "x: the cloud has no points and was taken as none",
    )


def test_made_cameras_are_what_they_say() -> None:
    """The tests' own cameras: right-handed, and a quaternion that turns as its rows do."""
    for camera in rig_cameras():
        w, x, y, z = camera.quat()
        turned = np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
            ]
        )
        np.testing.assert_allclose(turned, camera.rows(), atol=1e-12)
        assert np.linalg.det(camera.rows()) == pytest.approx(1)
