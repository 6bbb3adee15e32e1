"""Orientation, colour profiles, focal length, and what ``convert`` makes of other images."""

import io
from pathlib import Path

import cv2
import numpy as np
import oracles_io
import pytest
from PIL import Image, ImageCms, ImageOps

from diff4splat.errors import InputError
from diff4splat.io.photos.images import Photo, read_photo

ORIENTATION, EXIF_IFD, FOCAL_35MM = 0x0112, 0x8769, 0xA405


def levels(photo: Photo) -> np.ndarray:
    return np.rint(photo.rgb.numpy() * 255).astype(np.uint8)


def exif(orientation: object = None, focal: object = None) -> Image.Exif:
    data = Image.Exif()
    if orientation is not None:
        data[ORIENTATION] = orientation
    if focal is not None:
        data.get_ifd(EXIF_IFD)[FOCAL_35MM] = focal
    return data


def swapped_profile() -> bytes:
    """sRGB with its red and green primaries exchanged: a conversion nobody can overlook."""
    data = bytearray(ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes())
    red, green = data.index(b"rXYZ"), data.index(b"gXYZ")
    data[red : red + 4], data[green : green + 4] = b"gXYZ", b"rXYZ"
    name = "sRGB built-in".encode("utf-16-be")
    assert name in data
    return bytes(data.replace(name, "made for us a".encode("utf-16-be")))


@pytest.mark.parametrize("kind", ["PNG", "TIFF"])
@pytest.mark.parametrize("orientation", range(1, 9))
def test_images_are_upright(tmp_path: Path, kind: str, orientation: int) -> None:
    image = oracles_io.photograph()
    image.save(tmp_path / "a", kind, exif=exif(orientation))
    image.getexif()[ORIENTATION] = orientation
    photo = read_photo(tmp_path / "a")
    assert np.array_equal(levels(photo), np.asarray(ImageOps.exif_transpose(image)))
    assert photo.notes == (("EXIF orientation applied",) if orientation > 1 else ())


@pytest.mark.parametrize("kind", ["JPEG", "WEBP", "AVIF", "MPO"])
def test_lossy_images_are_upright_too(tmp_path: Path, kind: str) -> None:
    oracles_io.photograph(48, 20).save(tmp_path / "a", kind, exif=exif(6))
    photo = read_photo(tmp_path / "a")
    assert photo.rgb.shape == (48, 20, 3)
    assert photo.notes == ("EXIF orientation applied",)


@pytest.mark.parametrize("suffix", [".png", ".tiff"])
def test_deep_images_are_upright_too(tmp_path: Path, suffix: str) -> None:
    deep = np.asarray(oracles_io.photograph()).astype(np.uint16) * 257
    file = tmp_path / f"a{suffix}"
    cv2.imwrite(str(file), deep[..., ::-1])
    if suffix == ".png":
        chunk = exif(6).tobytes().removeprefix(b"Exif\0\0")
        data = file.read_bytes()
        body = b"eXIf" + chunk
        crc = __import__("zlib").crc32(body).to_bytes(4, "big")
        file.write_bytes(data[:33] + len(chunk).to_bytes(4, "big") + body + crc + data[33:])
    photo = read_photo(file, convert=True)
    want = np.asarray(oracles_io.photograph())
    if suffix == ".png":
        want = np.rot90(want, -1)
        assert photo.notes == ("16 bits reduced to 8", "EXIF orientation applied")
    assert np.array_equal(levels(photo), want)


@pytest.mark.parametrize("orientation", [0, 9, 65535])
def test_orientations_that_do_not_exist_are_ignored(tmp_path: Path, orientation: int) -> None:
    oracles_io.photograph().save(tmp_path / "a.png", exif=exif(orientation))
    photo = read_photo(tmp_path / "a.png")
    assert photo.notes == ()
    assert photo.rgb.shape == (20, 24, 3)


@pytest.mark.parametrize(("stored", "want"), [(26, 26.0), (0, None), (None, None), (600, 600.0)])
@pytest.mark.parametrize("kind", ["JPEG", "PNG", "WEBP"])
def test_the_focal_length_for_35_mm_film(
    tmp_path: Path, kind: str, stored: int | None, want: float | None
) -> None:
    oracles_io.photograph().save(tmp_path / "a", kind, exif=exif(1, stored))
    assert read_photo(tmp_path / "a").focal_35mm == want


@pytest.mark.parametrize("value", ["wide", (24, 70), float("nan"), -3])
def test_focal_lengths_that_are_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, value: object
) -> None:
    oracles_io.photograph().save(tmp_path / "a.jpg", exif=exif(6, 26))
    monkeypatch.setattr(Image.Exif, "get_ifd", lambda *_: {FOCAL_35MM: value})
    photo = read_photo(tmp_path / "a.jpg")
    assert photo.focal_35mm is None
    assert photo.notes == ("EXIF orientation applied",)


@pytest.mark.parametrize("junk", [b"Exif\0\0junk", b"Exif\0\0MM\0*\xff\xff\xff\xff", b"Exif\0\0"])
def test_damaged_exif_does_not_cost_the_image(tmp_path: Path, junk: bytes) -> None:
    oracles_io.photograph().save(tmp_path / "a.jpg", exif=junk)
    photo = read_photo(tmp_path / "a.jpg")
    assert photo.rgb.shape == (20, 24, 3)
    assert photo.focal_35mm is None


def test_colour_profiles_are_applied(tmp_path: Path) -> None:
    image = Image.new("RGB", (20, 20), (255, 0, 0))
    image.save(tmp_path / "a.png", icc_profile=swapped_profile())
    photo = read_photo(tmp_path / "a.png")
    assert photo.notes == ("ICC profile 'made for us a' converted to sRGB",)
    assert np.abs(levels(photo)[0, 0].astype(int) - [0, 255, 0]).max() <= 2


@pytest.mark.parametrize("profile", [b"junk" * 50, b"\0" * 128, swapped_profile()[:300]])
def test_damaged_profiles_are_noted_and_ignored(tmp_path: Path, profile: bytes) -> None:
    oracles_io.photograph().save(tmp_path / "a.png", icc_profile=profile)
    photo = read_photo(tmp_path / "a.png")
    assert photo.notes == ("ICC profile is damaged or does not fit the image and was ignored",)
    assert np.array_equal(levels(photo), np.asarray(oracles_io.photograph()))


def test_plain_photographs_are_the_same_with_convert(tmp_path: Path) -> None:
    oracles_io.photograph().save(tmp_path / "a.png")
    assert read_photo(tmp_path / "a.png", convert=True).notes == ()


@pytest.mark.parametrize("suffix", [".png", ".tiff"])
def test_sixteen_bits_are_divided_by_257(tmp_path: Path, suffix: str) -> None:
    deep = np.random.default_rng(0).integers(0, 65536, (20, 24, 3), np.uint16)
    deep[0, 0], deep[0, 1] = 65535, 128 * 257
    cv2.imwrite(str(tmp_path / f"a{suffix}"), deep[..., ::-1])
    photo = read_photo(tmp_path / f"a{suffix}", convert=True)
    assert photo.notes == ("16 bits reduced to 8",)
    assert np.array_equal(levels(photo), np.floor(deep / 257 + 0.5).astype(np.uint8))


@pytest.mark.parametrize("mode", ["I;16", "I"])
def test_grey_sixteen_bits(tmp_path: Path, mode: str) -> None:
    deep = (np.arange(400).reshape(20, 20) * 150).astype(np.uint16)
    image = Image.fromarray(deep if mode == "I;16" else deep.astype(np.int32))
    assert image.mode == mode
    image.save(tmp_path / "a.tiff")
    photo = read_photo(tmp_path / "a.tiff", convert=True)
    assert photo.notes == ("16 bits reduced to 8", "grey repeated as RGB")
    want = np.floor(deep / 257 + 0.5).astype(np.uint8)
    assert np.array_equal(levels(photo), np.repeat(want[..., None], 3, 2))


def test_floating_point_from_0_to_1_only(tmp_path: Path) -> None:
    ramp = np.linspace(0, 1, 400, dtype=np.float32).reshape(20, 20)
    Image.fromarray(ramp).save(tmp_path / "a.tiff")
    photo = read_photo(tmp_path / "a.tiff", convert=True)
    assert photo.notes[0] == "floating point from 0 to 1 reduced to 8 bits"
    assert np.abs(photo.rgb[..., 1].numpy() - ramp).max() <= 0.5 / 255 + 1e-6
    for worst in (2.0, -1.0, np.nan):
        bad = ramp.copy()
        bad[3, 3] = worst
        Image.fromarray(bad).save(tmp_path / "a.tiff")
        with pytest.raises(InputError, match="expected values from 0 to 1"):
            read_photo(tmp_path / "a.tiff", convert=True)


def test_damaged_deep_images(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    deep = np.random.default_rng(0).integers(0, 65536, (40, 40, 3), np.uint16)
    cv2.imwrite(str(tmp_path / "a.tiff"), deep)
    whole = (tmp_path / "a.tiff").read_bytes()
    (tmp_path / "a.tiff").write_bytes(whole[:4] + bytes(4) + whole[8:])
    with pytest.raises(InputError):
        read_photo(tmp_path / "a.tiff", convert=True)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("mode", ["L", "1"])
def test_grey_is_repeated(tmp_path: Path, mode: str) -> None:
    grey = oracles_io.photograph().convert(mode)
    grey.save(tmp_path / "a.png")
    photo = read_photo(tmp_path / "a.png", convert=True)
    assert photo.notes == ("grey repeated as RGB",)
    assert np.array_equal(levels(photo), np.asarray(grey.convert("RGB")))


def test_alpha_is_composited_over_white(tmp_path: Path) -> None:
    image = Image.new("RGBA", (20, 20), (200, 100, 0, 51))
    image.putpixel((0, 0), (200, 100, 0, 255))
    image.putpixel((1, 0), (200, 100, 0, 0))
    image.save(tmp_path / "a.png")
    photo = read_photo(tmp_path / "a.png", convert=True)
    assert photo.notes == ("alpha composited over white",)
    got = levels(photo)
    assert got[0, 0].tolist() == [200, 100, 0]
    assert got[0, 1].tolist() == [255, 255, 255]
    assert got[5, 5].tolist() == [244, 224, 204]


def test_opaque_alpha_is_dropped(tmp_path: Path) -> None:
    oracles_io.photograph().convert("RGBA").save(tmp_path / "a.png")
    photo = read_photo(tmp_path / "a.png", convert=True)
    assert photo.notes == ("alpha channel dropped (opaque everywhere)",)
    assert np.array_equal(levels(photo), np.asarray(oracles_io.photograph()))


@pytest.mark.parametrize("mode", ["LA", "RGBA"])
def test_profile_and_alpha_together(tmp_path: Path, mode: str) -> None:
    image = Image.new("RGBA", (20, 20), (255, 0, 0, 128)).convert(mode)
    image.save(tmp_path / "a.png", icc_profile=swapped_profile())
    photo = read_photo(tmp_path / "a.png", convert=True)
    assert photo.notes[-1] == "alpha composited over white"
    if mode == "RGBA":
        assert np.abs(levels(photo)[0, 0].astype(int) - [127, 255, 127]).max() <= 2


def test_palettes_are_expanded_with_their_transparency(tmp_path: Path) -> None:
    image = oracles_io.photograph().convert("P")
    image.save(tmp_path / "a.png")
    photo = read_photo(tmp_path / "a.png", convert=True)
    assert photo.notes == ("palette expanded",)
    assert np.array_equal(levels(photo), np.asarray(image.convert("RGB")))
    image.save(tmp_path / "b.png", transparency=image.getpixel((0, 0)))
    photo = read_photo(tmp_path / "b.png", convert=True)
    assert photo.notes == ("palette expanded", "alpha composited over white")
    assert levels(photo)[0, 0].tolist() == [255, 255, 255]


@pytest.mark.parametrize(("mode", "kind"), [("CMYK", "JPEG"), ("CMYK", "TIFF"), ("YCbCr", "TIFF")])
def test_other_colour_models(tmp_path: Path, mode: str, kind: str) -> None:
    Image.new("RGB", (20, 20), (200, 100, 50)).convert(mode).save(tmp_path / "a", kind)
    photo = read_photo(tmp_path / "a", convert=True)
    assert photo.notes == (f"converted from {mode} to RGB",)
    assert np.abs(levels(photo)[9, 9].astype(int) - [200, 100, 50]).max() <= 4


def test_lab_goes_through_its_own_profile(tmp_path: Path) -> None:
    lab = ImageCms.profileToProfile(
        Image.new("RGB", (20, 20), (200, 100, 50)),
        ImageCms.createProfile("sRGB"),
        ImageCms.createProfile("LAB"),
        outputMode="LAB",
    )
    lab.save(tmp_path / "a.tiff")
    photo = read_photo(tmp_path / "a.tiff", convert=True)
    assert np.abs(levels(photo)[9, 9].astype(int) - [200, 100, 50]).max() <= 4


@pytest.mark.parametrize("kind", ["GIF", "WEBP", "PNG", "TIFF"])
def test_the_first_image_of_an_animation(tmp_path: Path, kind: str) -> None:
    first = Image.new("RGB", (20, 20), (255, 0, 0))
    other = Image.new("RGB", (20, 20), (0, 0, 255))
    first.save(tmp_path / "a", kind, save_all=True, append_images=[other])
    photo = read_photo(tmp_path / "a", convert=True)
    assert photo.notes[0] == "the first of 2 images in the file was used"
    assert np.abs(levels(photo)[9, 9].astype(int) - [255, 0, 0]).max() <= 3


def test_reading_twice_gives_the_same_and_own_memory(tmp_path: Path) -> None:
    stream = io.BytesIO()
    oracles_io.photograph().save(stream, "JPEG")
    (tmp_path / "a.jpg").write_bytes(stream.getvalue())
    first, second = read_photo(tmp_path / "a.jpg"), read_photo(tmp_path / "a.jpg")
    first.rgb.zero_()
    assert float(second.rgb.max()) > 0
