"""Depth maps of other tools: numbers as they are, and files that are none."""

from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from PIL import Image

from diff4splat.errors import InputError
from diff4splat.io.depth_maps.depth_file import read_depth_file

VALUES = np.arange(12, dtype=np.float32).reshape(3, 4) + 0.5


def exr(file: Path, **channels: np.ndarray) -> Path:
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    with OpenEXR.File(header, channels) as opened:
        opened.write(str(file))
    return file


def npy(file: Path, values: np.ndarray) -> Path:
    np.save(file, values)
    return file


@pytest.mark.parametrize(
    ("name", "quantity"),
    [("Z", "metric"), ("depth", "metric"), ("distance", "distance"), ("Y", "")],
)
def test_exr_channels_say_what_they_are(tmp_path: Path, name: str, quantity: str) -> None:
    found = read_depth_file(exr(tmp_path / "a.exr", **{name: VALUES}))
    np.testing.assert_array_equal(found.values, VALUES)
    assert found.quantity == quantity


@pytest.mark.parametrize("dtype", ["<f4", ">f4", "<f8", "<f2", "<u2", "|u1"])
@pytest.mark.parametrize("order", ["C", "F"])
def test_arrays_of_any_number(tmp_path: Path, dtype: str, order: str) -> None:
    values = np.array(VALUES, dtype=dtype, order=order)
    found = read_depth_file(npy(tmp_path / "a.npy", values))
    np.testing.assert_array_equal(found.values, values.astype(np.float32))
    assert found.quantity == ""


def test_axes_of_one_are_dropped(tmp_path: Path) -> None:
    assert read_depth_file(npy(tmp_path / "a.npy", VALUES[None, ..., None])).values.shape == (3, 4)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_grey_png_of_8_and_16_bits(tmp_path: Path, dtype: type) -> None:
    values = (VALUES * 20).astype(dtype)
    Image.fromarray(values).save(tmp_path / "a.png")
    np.testing.assert_array_equal(read_depth_file(tmp_path / "a.png").values, values)


def test_a_png_may_be_turned(tmp_path: Path) -> None:
    exif = Image.Exif()
    exif[0x0112] = 6
    Image.fromarray(VALUES.astype(np.uint8)).save(tmp_path / "a.png", exif=exif)
    assert read_depth_file(tmp_path / "a.png").orientation == 6


def test_coloured_pictures_of_depth_are_refused(tmp_path: Path) -> None:
    Image.new("RGB", (8, 8)).save(tmp_path / "a.png")
    with pytest.raises(InputError, match="expected a grey PNG, got colours"):
        read_depth_file(tmp_path / "a.png")


@pytest.mark.parametrize("suffix", [".exr", ".npy", ".png"])
def test_every_cut_is_refused(tmp_path: Path, suffix: str) -> None:
    file = tmp_path / f"a{suffix}"
    values = np.random.default_rng(0).random((40, 40)).astype(np.float32)
    if suffix == ".exr":
        exr(file, Z=values)
    elif suffix == ".npy":
        npy(file, values)
    else:
        Image.fromarray((values * 60000).astype(np.uint16)).save(file)
    content = file.read_bytes()
    for share in (0.0, 0.01, 0.5, 0.9):
        file.write_bytes(content[: int(share * len(content))])
        with pytest.raises(InputError, match=r"a\."):
            read_depth_file(file)


@pytest.mark.parametrize("shape", [(3,), (2, 3, 4), (1, 1), (0, 5)])
def test_other_shapes_are_refused(tmp_path: Path, shape: tuple[int, ...]) -> None:
    file = npy(tmp_path / "a.npy", np.zeros(shape))
    if shape == (1, 1):
        assert read_depth_file(file).values.shape == (1, 1)
        return
    with pytest.raises(InputError, match="depth map"):
        read_depth_file(file)


def test_huge_sizes_are_refused_before_memory_is_taken(tmp_path: Path) -> None:
    header = b"{'descr': '<f4', 'fortran_order': False, 'shape': (2000000, 2000000), }\n"
    start = b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header
    (tmp_path / "a.npy").write_bytes(start + bytes(64))
    with pytest.raises(InputError, match="up to 100,000,000 pixels, got 2000000×2000000"):
        read_depth_file(tmp_path / "a.npy")


def test_an_array_of_objects_is_never_unpickled(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", np.array([{}], dtype=object))
    with pytest.raises(InputError, match="header of an array of numbers"):
        read_depth_file(tmp_path / "a.npy")


def test_other_files(tmp_path: Path) -> None:
    for name in ("absent.npy", "absent.exr"):
        with pytest.raises(InputError, match="no such file"):
            read_depth_file(tmp_path / name)
    with pytest.raises(InputError, match=r"\.exr, \.png, \.npy"):
        read_depth_file(tmp_path / "a.tiff")
    exr(tmp_path / "rgb.exr", R=VALUES, G=VALUES, B=VALUES)
    with pytest.raises(InputError, match="channel Z, depth or distance, got B, G, R"):
        read_depth_file(tmp_path / "rgb.exr")
