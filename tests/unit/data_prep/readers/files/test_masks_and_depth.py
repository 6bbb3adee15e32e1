"""What lies beside an image: masks, depth, transparency, and numbers in place of levels."""

from pathlib import Path

import cv2
import numpy as np
import OpenEXR
import pytest
import torch
from capture_folders import (
    change_json,
    write_image,
    write_transforms,
)

from diff4splat.data.capture.split import report_split
from diff4splat.data_prep.readers.options import ReadOptions
from diff4splat.data_prep.readers.registry import read_capture
from diff4splat.errors import FileFormatError, InputError


def change_frames(folder: Path, change) -> None:
    change_json(folder / "transforms.json", lambda root: [change(f) for f in root["frames"]])


def test_masked_pixels_do_not_count(tmp_path: Path) -> None:
    write_transforms(tmp_path, count=4)
    mask = np.full((24, 36), 255, np.uint8)
    mask[:5] = 0
    mask[20, 30] = 1
    cv2.imwrite(str(tmp_path / "mask.png"), mask)
    change_frames(tmp_path, lambda frame: frame.update(mask_path="mask.png"))
    counts = read_capture(tmp_path).frames.read(2).counts
    assert torch.equal(counts, torch.from_numpy(mask > 0))
    halves = read_capture(tmp_path, ReadOptions(downscale=2)).frames.read(2).counts
    assert halves.shape == (12, 18)
    assert halves.sum(1).tolist() == [0, 0, 0] + [18] * 9
    cv2.imwrite(str(tmp_path / "mask.png"), mask[:-1])
    with pytest.raises(FileFormatError, match=r"mask\.png: expected a mask as large as its image"):
        read_capture(tmp_path).frames.read(2)
    cv2.imwrite(str(tmp_path / "mask.png"), mask * 0)
    with pytest.raises(FileFormatError, match=r"mask\.png: .*got black everywhere; black covers"):
        read_capture(tmp_path).frames.read(2)
    (tmp_path / "mask.png").unlink()
    with pytest.raises(FileFormatError, match="frame 0: 'mask_path': expected the file"):
        read_capture(tmp_path)


def depth_files(folder: Path, depth: np.ndarray) -> dict[str, dict]:
    """What the file says of depth, per way to store it."""
    cv2.imwrite(str(folder / "mm.png"), np.round(depth * 1000).astype(np.uint16))
    cv2.imwrite(str(folder / "half.png"), np.round(depth * 2).astype(np.uint16))
    np.save(folder / "float.npy", depth.astype(np.float32)[..., None])
    part = OpenEXR.Part(
        {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage},
        {"Z": depth.astype(np.float32)},
    )
    OpenEXR.File([part]).write(str(folder / "z.exr"))
    return {
        "mm.png": {},
        "half.png": {"depth_unit_scale_factor": 0.5},
        "float.npy": {},
        "z.exr": {},
    }


@pytest.mark.parametrize("name", ["mm.png", "half.png", "float.npy", "z.exr"])
def test_depth_is_read_in_scene_units(tmp_path: Path, name: str) -> None:
    write_transforms(tmp_path, count=3)
    depth = np.zeros((24, 36))
    depth[4:, 2:] = 3.5
    depth[10, 10] = 0.5
    unit = depth_files(tmp_path, depth)[name]
    change_frames(tmp_path, lambda frame: frame.update(depth_file_path=name))
    change_json(tmp_path / "transforms.json", lambda root: root.update(unit))
    capture = read_capture(tmp_path)
    got = capture.frames.read(1).depth
    torch.testing.assert_close(got, torch.from_numpy(depth).float())
    small = read_capture(tmp_path, ReadOptions(downscale=3)).frames.read(1).depth
    assert float(small[3, 3]) == pytest.approx(3.5)
    assert float(small[0, 0]) == 0


def test_coarse_depth_is_repeated_and_rubbish_is_no_depth(tmp_path: Path) -> None:
    write_transforms(tmp_path, count=3)
    depth = np.array([[1, 2, 3], [4, np.nan, -1]], np.float32)
    np.save(tmp_path / "d.npy", depth)
    change_frames(tmp_path, lambda frame: frame.update(depth_file_path="d.npy"))
    got = read_capture(tmp_path).frames.read(0).depth
    want = torch.tensor([[1.0, 2, 3], [4, 0, 0]]).repeat_interleave(12, 0).repeat_interleave(12, 1)
    assert torch.equal(got, want)
    for odd, message in (
        (np.zeros((24, 24)), "depth shaped as its image, 36 x 24, got 24 x 24"),
        (np.zeros((24, 36, 3)), "expected depth of one channel"),
    ):
        np.save(tmp_path / "d.npy", odd)
        with pytest.raises(FileFormatError, match=message):
            read_capture(tmp_path).frames.read(0)


def test_one_standing_camera_is_enough_with_depth(tmp_path: Path) -> None:
    cameras = write_transforms(tmp_path, count=4)
    np.save(tmp_path / "d.npy", np.ones((24, 36), np.float32))
    pose = cameras[0].opengl()
    change_frames(tmp_path, lambda frame: frame.update(transform_matrix=pose))
    with pytest.raises(InputError, match="images from at least two places"):
        read_capture(tmp_path)
    change_frames(tmp_path, lambda frame: frame.update(depth_file_path="d.npy"))
    capture = read_capture(tmp_path)
    assert capture.camera_index.tolist() == [0] * 4
    assert report_split(capture).kind == "new times of training views"


def test_float_images_have_pixels_that_do_not_count(tmp_path: Path) -> None:
    write_transforms(tmp_path, count=3)
    rgb = np.full((24, 36, 3), 0.25, np.float32)
    rgb[3, 4, 1] = np.nan
    rgb[5, 5] = 7
    np.save(tmp_path / "a.npy", rgb)
    part = OpenEXR.Part(
        {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage},
        {name: np.ascontiguousarray(rgb[..., i]) for i, name in enumerate("RGB")},
    )
    OpenEXR.File([part]).write(str(tmp_path / "a.exr"))
    for name in ("a.npy", "a.exr"):
        change_frames(tmp_path, lambda frame, name=name: frame.update(file_path=name))
        capture = read_capture(tmp_path)
        frame = capture.frames.read(0)
        assert (~frame.counts).nonzero().tolist() == [[3, 4]]
        assert torch.isfinite(frame.rgb).all()
        assert frame.rgb[5, 5].tolist() == [1, 1, 1]
        assert any("NaN do not count" in note for note in capture.notes)
    np.save(tmp_path / "a.npy", rgb * np.nan)
    change_frames(tmp_path, lambda frame: frame.update(file_path="a.npy"))
    with pytest.raises(FileFormatError, match="expected an image, got NaN everywhere"):
        read_capture(tmp_path).frames.read(0)


def test_transparent_pixels_say_nothing_unless_a_background_is_given(tmp_path: Path) -> None:
    write_transforms(tmp_path, count=3)
    rgba = np.full((24, 36, 4), 200, np.uint8)
    rgba[:6, :, 3] = 0
    write_image(tmp_path / "images" / "frame_00001.png", rgba)
    capture = read_capture(tmp_path)
    assert capture.background is None
    assert capture.frames.read(0).counts.sum() == 18 * 36
    assert any("transparent pixels do not count" in note for note in capture.notes)
    capture = read_capture(tmp_path, ReadOptions(background=(0.0, 0.0, 1.0)))
    frame = capture.frames.read(0)
    assert frame.counts is None
    assert frame.rgb[0, 0].tolist() == [0, 0, 1]


def test_damaged_float_images_are_named(tmp_path: Path) -> None:
    write_transforms(tmp_path, count=3)
    rgb = np.random.default_rng(0).random((24, 36, 3)).astype(np.float32)
    part = OpenEXR.Part(
        {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage},
        {name: np.ascontiguousarray(rgb[..., i]) for i, name in enumerate("RGB")},
    )
    OpenEXR.File([part]).write(str(tmp_path / "a.exr"))
    np.save(tmp_path / "a.npy", rgb)
    for name in ("a.exr", "a.npy"):
        file = tmp_path / name
        whole = file.read_bytes()
        change_frames(tmp_path, lambda frame, name=name: frame.update(file_path=name))
        for length in (40, len(whole) // 2, len(whole) - 9):
            file.write_bytes(whole[:length])
            with pytest.raises(FileFormatError, match=rf"{name}: expected a whole"):
                read_capture(tmp_path).frames.read(0)
    part = OpenEXR.Part({"type": OpenEXR.scanlineimage}, {"Q": rgb[..., 0].copy()})
    OpenEXR.File([part]).write(str(tmp_path / "q.exr"))
    change_frames(tmp_path, lambda frame: frame.update(file_path="q.exr"))
    with pytest.raises(FileFormatError, match=r"q\.exr: expected channels R, G and B, got \['Q'\]"):
        read_capture(tmp_path).frames.read(0)
