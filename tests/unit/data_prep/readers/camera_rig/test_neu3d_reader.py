"""Neural 3D Video: LLFF poses, cameras by name, videos and images, camera 0 held out."""

import shutil
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
import torch
from capture_checks import assert_pose, assert_sees, projected
from capture_folders import llff_rows, rig_cameras, write_image, write_neu3d, write_video

from diff4splat.data.capture.split import report_split
from diff4splat.data_prep.readers.files.lru_cache import LruCache
from diff4splat.data_prep.readers.files.video_file import VideoFile
from diff4splat.data_prep.readers.options import ReadOptions
from diff4splat.data_prep.readers.registry import detect_format, read_capture
from diff4splat.errors import ConfigError, FileFormatError

FPS, SIZE_PX = 25.0, (48, 80)


def block_video(frames: int = 9, size_px: tuple[int, int] = SIZE_PX) -> list[np.ndarray]:
    """A grey level that tells the frame, and a white block in the upper left."""
    images = [np.full((*size_px, 3), 20 + 20 * index, np.uint8) for index in range(frames)]
    for image in images:
        image[:16, :16] = (250, 10, 10)
    return images


def write_videos(folder: Path, count: int = 3, frames: int = 9) -> Path:
    cameras = rig_cameras(count, focal_px=(60.0, 60.0), center_px=(40.0, 24.0), size_px=SIZE_PX)
    for number in range(count):
        write_video(folder / f"cam{number:02d}.mp4", block_video(frames), FPS)
    np.save(folder / "poses_bounds.npy", llff_rows(cameras, full=2))
    return folder


def test_the_point_lies_in_its_pixel_and_camera_0_is_held_out(tmp_path: Path) -> None:
    cameras = write_neu3d(tmp_path)
    assert detect_format(tmp_path) == "neu3d"
    capture = read_capture(tmp_path)
    assert capture.times_s.tolist() == pytest.approx([0, 1 / 30, 2 / 30] * 4)
    assert capture.camera_index.tolist() == [0] * 3 + [1] * 3 + [2] * 3 + [3] * 3
    assert capture.held_out.tolist() == [True] * 3 + [False] * 9
    for index in range(12):
        camera, time = cameras[index // 3], (index % 3) / 30
        assert_pose(capture, index, camera)
        assert_sees(capture, index, camera, time)
    assert report_split(capture).kind == "new views"
    assert capture.split_reason == "camera 0 held out, as given by the data set"
    assert capture.cameras.focal_px[0].tolist() == [31, 31]
    assert any("30 frames per second were assumed" in note for note in capture.notes)


def test_cameras_count_in_the_order_of_their_names_whatever_their_numbers(tmp_path: Path) -> None:
    cameras = write_neu3d(tmp_path, count=3)
    for old, new in (("cam02", "cam10"), ("cam01", "cam9")):
        (tmp_path / old).rename(tmp_path / new)
    capture = read_capture(tmp_path, ReadOptions(hold_out=(2,)))
    for index, camera in enumerate(cameras):
        assert_pose(capture, 3 * index, camera)
    assert capture.held_out.tolist() == [False] * 6 + [True] * 3
    assert any("cam9 is 1, cam10 is 2" in note for note in capture.notes)


def test_an_image_that_is_missing_makes_a_gap_and_shifts_nothing(tmp_path: Path) -> None:
    write_neu3d(tmp_path, frames=4)
    (tmp_path / "cam02" / "images" / "0001.png").unlink()
    capture = read_capture(tmp_path, ReadOptions(fps=10.0))
    times_s = capture.times_s[capture.camera_index == 2].tolist()
    assert times_s == pytest.approx([0, 0.2, 0.3])
    assert any("cam02 lacks 1 of 4 images" in note for note in capture.notes)


def test_every_second_time_of_every_camera(tmp_path: Path) -> None:
    write_neu3d(tmp_path, frames=5)
    capture = read_capture(tmp_path, ReadOptions(frame_step=2, fps=10.0))
    assert capture.times_s.tolist() == pytest.approx([0, 0.2, 0.4] * 4)
    assert any("one time in 2" in note for note in capture.notes)


def test_points_beside_the_videos_are_read(tmp_path: Path) -> None:
    write_neu3d(tmp_path)
    rows = "1 2 3 255 0 51\n4 5 6 0 255 0\n"
    header = ["ply", "format ascii 1.0", "element vertex 2"]
    header += [f"property float {axis}" for axis in "xyz"]
    header += [f"property uchar {name}" for name in ("red", "green", "blue")]
    (tmp_path / "points3D_downsample2.ply").write_text("\n".join([*header, "end_header", rows]))
    points = read_capture(tmp_path).points
    assert points.positions.tolist() == [[1, 2, 3], [4, 5, 6]]
    torch.testing.assert_close(points.rgb[0], torch.tensor([1, 0, 0.2]))


def test_videos_are_read_frame_by_frame_with_their_own_rate(tmp_path: Path) -> None:
    capture = read_capture(write_videos(tmp_path))
    assert len(capture) == 27
    assert capture.times_s[:9].tolist() == pytest.approx([index / FPS for index in range(9)])
    assert capture.cameras.size_px == SIZE_PX
    assert capture.cameras.focal_px[0].tolist() == [60, 60]
    # In any order, and twice the same.
    for index in (3, 8, 0, 5, 3, 26, 9):
        rgb = capture.frames.read(index).rgb
        assert float(rgb[40, 70, 0]) * 255 == pytest.approx(20 + 20 * (index % 9), abs=6)
        assert float(rgb[4, 4, 0] - rgb[4, 4, 1]) > 0.5
    assert torch.equal(capture.frames.read(3).rgb, capture.frames.read(3).rgb)


def test_threads_may_read_at_once(tmp_path: Path) -> None:
    frames = read_capture(write_videos(tmp_path)).frames
    order = [7, 20, 3, 11, 26, 0, 15, 8, 1, 23] * 3
    with ThreadPoolExecutor(4) as pool:
        read = list(pool.map(lambda index: frames.read(index).rgb, order))
    again = read_capture(tmp_path).frames
    for index, rgb in zip(order, read, strict=True):
        assert torch.equal(rgb, again.read(index).rgb)


def test_videos_shrink_exactly_even_where_a_block_is_cut(tmp_path: Path) -> None:
    full = read_capture(write_videos(tmp_path))
    small = read_capture(tmp_path, ReadOptions(downscale=7))
    assert small.cameras.size_px == (6, 11)
    assert small.frames.read(2).rgb.shape == (6, 11, 3)
    at_full, at_small = projected(full, 2, 0.1), projected(small, 2, 0.1)
    assert at_small == pytest.approx((at_full[0] / 7, at_full[1] / 7))
    assert float(small.frames.read(2).rgb[5, 10, 0]) * 255 == pytest.approx(60, abs=6)


def test_images_are_preferred_to_videos_when_all_cameras_have_them(tmp_path: Path) -> None:
    write_videos(tmp_path, count=2)
    for number in range(2):
        for frame in range(2):
            image = np.full((24, 40, 3), 7, np.uint8)
            write_image(tmp_path / f"cam{number:02d}" / "images" / f"{frame:04d}.png", image)
    capture = read_capture(tmp_path)
    assert (len(capture), capture.cameras.size_px) == (4, (24, 40))
    assert capture.cameras.focal_px[0].tolist() == [30, 30]
    shutil.rmtree(tmp_path / "cam01")
    assert len(read_capture(tmp_path)) == 18
    (tmp_path / "cam00.mp4").unlink()
    with pytest.raises(FileFormatError, match="no video of cam00 and a video but no images of"):
        read_capture(tmp_path)


def test_a_video_keeps_no_more_than_it_may(tmp_path: Path) -> None:
    write_video(tmp_path / "cam00.mp4", block_video(), FPS)
    cache = LruCache(3 * 48 * 80 * 3)
    video = VideoFile(tmp_path / "cam00.mp4", 1, cache)
    assert (video.frames, video.size_px) == (9, SIZE_PX)
    for index in range(9):
        video.read(index)
    kept = [index for index in range(9) if cache.get((video.file, index)) is not None]
    assert kept == [6, 7, 8]
    for index in (0, 5, 2, 8):
        assert float(video.read(index)[40, 70].mean()) == pytest.approx(20 + 20 * index, abs=6)


def test_a_video_that_ends_early_is_named(tmp_path: Path) -> None:
    write_video(tmp_path / "cam00.mp4", block_video(), FPS)
    video = VideoFile(tmp_path / "cam00.mp4", 1, LruCache(1 << 20))
    with pytest.raises(FileFormatError, match=r"cam00\.mp4: expected 9 frames, got 9; the video"):
        video.read(9)
    (tmp_path / "cam01.mp4").write_bytes(b"\0" * 99)
    with pytest.raises(FileFormatError, match=r"cam01\.mp4: expected a video, got a damaged"):
        VideoFile(tmp_path / "cam01.mp4", 1, LruCache(1))


def test_videos_of_several_rates_need_a_rate(tmp_path: Path) -> None:
    write_videos(tmp_path, count=2)
    write_video(tmp_path / "cam01.mp4", block_video(), 50.0)
    with pytest.raises(FileFormatError, match="videos of one frame rate, got 25 to 50"):
        read_capture(tmp_path)
    assert len(read_capture(tmp_path, ReadOptions(fps=25.0))) == 18


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda rows: rows[:-1], r"a row for each of 4 cameras \(cam00 to cam03\), got 3 rows"),
        (lambda rows: rows[:, :15], r"expected rows of 17 numbers \(LLFF\), got an array of"),
        (lambda rows: np.where(np.arange(17) == 3, np.nan, rows), "cam00: expected finite numbers"),
        (lambda rows: rows * np.where(np.arange(17) == 14, -1, 1), "focal length above 0"),
        (lambda rows: rows * np.where(np.arange(17) % 5 == 0, -1, 1), "got determinant -1"),
        (lambda rows: rows * np.where(np.arange(17) == 4, 2, 1), "shaped as its camera, 72 x 96"),
        (lambda rows: rows.astype(object), "expected the header of an array of numbers"),
    ],
)
def test_arrays_that_make_no_sense_are_refused(tmp_path: Path, change, message: str) -> None:
    write_neu3d(tmp_path)
    file = tmp_path / "poses_bounds.npy"
    np.save(file, change(np.load(file)), allow_pickle=True)
    with pytest.raises(FileFormatError, match=message):
        read_capture(tmp_path)


def test_an_array_that_is_cut_off_is_refused(tmp_path: Path) -> None:
    write_neu3d(tmp_path)
    file = tmp_path / "poses_bounds.npy"
    file.write_bytes(file.read_bytes()[:-40])
    with pytest.raises(FileFormatError, match="expected a whole NumPy file"):
        read_capture(tmp_path)


def test_cameras_that_are_not_there_cannot_be_held_out(tmp_path: Path) -> None:
    write_neu3d(tmp_path)
    with pytest.raises(ConfigError, match=r"expected cameras from 0 to 3, got \[4\]"):
        read_capture(tmp_path, ReadOptions(hold_out=(4,)))
    with pytest.raises(ConfigError, match="got all 4 of them; hold out fewer"):
        read_capture(tmp_path, ReadOptions(hold_out=(0, 1, 2, 3)))


def test_images_need_numbers_of_their_own(tmp_path: Path) -> None:
    write_neu3d(tmp_path)
    images = tmp_path / "cam01" / "images"
    (images / "0002.png").rename(images / "last.png")
    with pytest.raises(FileFormatError, match=r"last\.png: expected images numbered .*no number"):
        read_capture(tmp_path)
    (images / "last.png").rename(images / "x_0001.png")
    with pytest.raises(FileFormatError, match=r"x_0001\.png: .*got that of 0001\.png again"):
        read_capture(tmp_path)


def test_coffee_martini_comes_with_a_warning(tmp_path: Path) -> None:
    write_neu3d(tmp_path / "coffee_martini")
    assert any("cam13" in note for note in read_capture(tmp_path / "coffee_martini").notes)
