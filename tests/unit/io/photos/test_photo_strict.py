"""What counts as a photograph: everything else is refused in one line that says what to do."""

import io
import struct
import zlib
from pathlib import Path

import cv2
import numpy as np
import oracles_io
import pytest
from PIL import Image, ImageCms

from diff4splat.errors import InputError
from diff4splat.io.photos.images import read_photo

ADVICE = "convert it to 8-bit RGB, or pass --convert"


def refusal(file: Path, convert: bool = False) -> str:
    with pytest.raises(InputError) as caught:
        read_photo(file, convert)
    assert str(caught.value).isprintable()
    assert str(file) in str(caught.value)
    return str(caught.value)


def encoded(kind: str, **options: object) -> bytes:
    stream = io.BytesIO()
    oracles_io.photograph().save(stream, kind, **options)
    return stream.getvalue()


@pytest.mark.parametrize("kind", ["PNG", "BMP", "TIFF"])
def test_lossless_photographs_come_back_exactly(tmp_path: Path, kind: str) -> None:
    oracles_io.photograph().save(tmp_path / "a", kind)
    photo = read_photo(str(tmp_path / "a"))
    assert photo.rgb.shape == (20, 24, 3)
    assert photo.notes == ()
    assert photo.focal_35mm is None
    want = np.asarray(oracles_io.photograph()).astype(np.float32) / 255
    assert np.array_equal(photo.rgb.numpy(), want)


@pytest.mark.parametrize("kind", ["JPEG", "WEBP", "AVIF"])
def test_lossy_photographs_come_back_nearly(tmp_path: Path, kind: str) -> None:
    oracles_io.photograph().resize((96, 80)).save(tmp_path / "a", kind, quality=95)
    photo = read_photo(tmp_path / "a")
    want = np.asarray(oracles_io.photograph().resize((96, 80))) / 255
    assert photo.notes == ()
    assert np.abs(photo.rgb.numpy() - want).mean() < 0.05
    assert 0 <= float(photo.rgb.min()) <= float(photo.rgb.max()) <= 1


def test_missing_folder_and_empty(tmp_path: Path) -> None:
    assert "got no such file" in refusal(tmp_path / "a.jpg")
    assert "got a folder" in refusal(tmp_path)
    (tmp_path / "a.jpg").touch()
    assert "got an empty file" in refusal(tmp_path / "a.jpg")
    assert "got a device" in refusal(Path("/dev/null"))


@pytest.mark.parametrize(
    "content", [b"hello, world", b"%PDF-1.7 ...", b"%!PS-Adobe-3.0 EPSF-3.0\n"]
)
def test_no_image_at_all(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "a.jpg").write_bytes(content)
    message = refusal(tmp_path / "a.jpg")
    assert "expected a JPEG, PNG, WebP, AVIF, TIFF or BMP image, got another kind" in message


@pytest.mark.parametrize("brand", [b"heic", b"heix", b"mif1"])
def test_heic_is_named(tmp_path: Path, brand: bytes) -> None:
    (tmp_path / "a.heic").write_bytes(b"\0\0\0\x18ftyp" + brand + bytes(100))
    message = refusal(tmp_path / "a.heic")
    assert "expected a JPEG, PNG, WebP" in message
    assert "got HEIC; save or export it as JPEG" in message


@pytest.mark.parametrize("kind", ["JPEG", "PNG", "WEBP", "AVIF", "TIFF", "BMP"])
def test_cut_off_files(tmp_path: Path, kind: str) -> None:
    whole = encoded(kind)
    steps = range(len(whole) // 16, len(whole) * 7 // 8, len(whole) // 16)
    for length in steps:
        (tmp_path / "a").write_bytes(whole[:length])
        message = refusal(tmp_path / "a")
        assert "expected a whole image, got a cut off or damaged one" in message or (
            "got another kind of file" in message and kind == "AVIF"
        )


@pytest.mark.parametrize("kind", ["PNG", "TIFF", "BMP"])
def test_a_cut_off_lossless_file_is_refused_or_every_pixel_is_right(
    tmp_path: Path, kind: str
) -> None:
    """A PNG whose last check sum is missing still holds the whole image."""
    whole, want = encoded(kind), np.asarray(oracles_io.photograph())
    for length in [*range(len(whole) // 2, len(whole), 17), *range(len(whole) - 22, len(whole))]:
        (tmp_path / "a").write_bytes(whole[:length])
        try:
            got = read_photo(tmp_path / "a").rgb.numpy() * 255
        except InputError:
            continue
        assert np.array_equal(got, want), length


@pytest.mark.parametrize("suffix", [".png", ".tiff"])
def test_cut_off_deep_files_are_not_half_converted(tmp_path: Path, suffix: str) -> None:
    deep = np.random.default_rng(0).integers(0, 65536, (40, 40, 3), np.uint16)
    cv2.imwrite(str(tmp_path / f"a{suffix}"), deep)
    whole = (tmp_path / f"a{suffix}").read_bytes()
    (tmp_path / f"a{suffix}").write_bytes(whole[: len(whole) * 3 // 4])
    assert "expected a whole image" in refusal(tmp_path / f"a{suffix}", convert=True)


def test_damaged_pixels(tmp_path: Path) -> None:
    whole = bytearray(encoded("PNG"))
    start = whole.index(b"IDAT") + 4
    whole[start : start + 40] = bytes(40)
    (tmp_path / "a.png").write_bytes(whole)
    assert "expected a whole image" in refusal(tmp_path / "a.png")


@pytest.mark.parametrize(
    ("mode", "kind", "says"),
    [
        ("L", "PNG", "a grey image"),
        ("L", "JPEG", "a grey image"),
        ("1", "PNG", "a grey image"),
        ("LA", "PNG", "an image with an alpha channel or transparency"),
        ("RGBA", "PNG", "an image with an alpha channel or transparency"),
        ("RGBA", "TIFF", "an image with an alpha channel or transparency"),
        ("P", "PNG", "a palette image"),
        ("P", "BMP", "a palette image"),
        ("P", "GIF", "a palette image"),
        ("I;16", "PNG", "16-bit or deeper channels"),
        ("I;16", "TIFF", "16-bit or deeper channels"),
        ("I", "TIFF", "16-bit or deeper channels"),
        ("F", "TIFF", "16-bit or deeper channels"),
        ("CMYK", "JPEG", "CMYK print colours"),
        ("CMYK", "TIFF", "CMYK print colours"),
        ("YCbCr", "TIFF", "YCbCr colours"),
        ("LAB", "TIFF", "CIE Lab colours"),
    ],
)
def test_other_kinds_of_image_are_named(tmp_path: Path, mode: str, kind: str, says: str) -> None:
    oracles_io.photograph().convert(mode).save(tmp_path / "a", kind)
    message = refusal(tmp_path / "a")
    assert f"expected an 8-bit RGB photograph, got {says}; {ADVICE}" in message


@pytest.mark.parametrize("kind", ["WEBP", "AVIF"])
def test_transparency_in_modern_formats(tmp_path: Path, kind: str) -> None:
    image = oracles_io.photograph().convert("RGBA")
    image.putalpha(100)
    image.save(tmp_path / "a", kind)
    assert f"an image with an alpha channel or transparency; {ADVICE}" in refusal(tmp_path / "a")


def test_a_transparent_colour_counts_as_transparency(tmp_path: Path) -> None:
    oracles_io.photograph().save(tmp_path / "rgb.png", transparency=(0, 0, 0))
    assert f"an image with an alpha channel or transparency; {ADVICE}" in refusal(
        tmp_path / "rgb.png"
    )
    palette = oracles_io.photograph().convert("P")
    palette.save(tmp_path / "p.png", transparency=3)
    assert f"a palette image; {ADVICE}" in refusal(tmp_path / "p.png")


@pytest.mark.parametrize("suffix", [".png", ".tiff"])
@pytest.mark.parametrize("channels", [1, 3, 4])
def test_deep_colour_is_noticed_although_pillow_hides_it(
    tmp_path: Path, suffix: str, channels: int
) -> None:
    deep = np.random.default_rng(0).integers(0, 65536, (20, 24, channels), np.uint16)
    cv2.imwrite(str(tmp_path / f"a{suffix}"), deep)
    assert f"16-bit or deeper channels; {ADVICE}" in refusal(tmp_path / f"a{suffix}")


@pytest.mark.parametrize("kind", ["GIF", "WEBP", "PNG", "TIFF", "AVIF"])
def test_animations_and_stacks(tmp_path: Path, kind: str) -> None:
    first = oracles_io.photograph()
    others = [first.rotate(90), first.rotate(180)]
    first.save(tmp_path / "a", kind, save_all=True, append_images=others)
    assert f"an animation or a stack of 3 images; {ADVICE}" in refusal(tmp_path / "a")


def test_a_phones_image_with_a_second_one_behind_it_is_normal(tmp_path: Path) -> None:
    first = oracles_io.photograph()
    first.save(tmp_path / "a.jpg", "MPO", save_all=True, append_images=[first.rotate(180)])
    first.save(tmp_path / "b.jpg", "JPEG")
    photo = read_photo(tmp_path / "a.jpg")
    assert photo.notes == ("the first of 2 images in the file was used",)
    assert bool((photo.rgb - read_photo(tmp_path / "b.jpg").rgb).abs().max() < 0.02)


@pytest.mark.parametrize("size", [(15, 40), (40, 15), (1, 1)])
@pytest.mark.parametrize("convert", [False, True])
def test_tiny_images(tmp_path: Path, size: tuple[int, int], convert: bool) -> None:
    Image.new("RGB", size).save(tmp_path / "a.png")
    says = f"expected at least 16x16 pixels, got {size[0]}x{size[1]}"
    assert says in refusal(tmp_path / "a.png", convert)


def png_header(width: int, height: int) -> bytes:
    body = b"IHDR" + struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    chunk = struct.pack(">I", len(body) - 4) + body + struct.pack(">I", zlib.crc32(body))
    return b"\x89PNG\r\n\x1a\n" + chunk + b"\0\0\0\0IDAT" + struct.pack(">I", zlib.crc32(b"IDAT"))


@pytest.mark.parametrize(
    ("size", "got"), [((10_001, 10_000), "10001x10000"), ((50_000, 50_000), "far more")]
)
@pytest.mark.parametrize("convert", [False, True])
def test_enormous_images_are_refused_by_their_header(
    tmp_path: Path, size: tuple[int, int], got: str, convert: bool
) -> None:
    (tmp_path / "a.png").write_bytes(png_header(*size))
    message = refusal(tmp_path / "a.png", convert)
    assert f"expected at most 100 megapixels, got {got}; make it smaller first" in message


def test_large_images_give_no_warning_of_their_own(tmp_path: Path) -> None:
    """Pillow alone warns from 89 megapixels; here the warning would be an error."""
    (tmp_path / "a.png").write_bytes(png_header(10_000, 10_000))
    assert "expected a whole image" in refusal(tmp_path / "a.png")


def test_the_preview_inside_a_raw_file_is_not_the_photograph(tmp_path: Path) -> None:
    oracles_io.photograph().save(tmp_path / "a.dng", "TIFF", tiffinfo={254: 1})
    assert "got a camera raw file; develop it and save it as JPEG" in refusal(tmp_path / "a.dng")


def test_profiles_are_no_reason_to_refuse(tmp_path: Path) -> None:
    profile = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    oracles_io.photograph().save(tmp_path / "a.png", icc_profile=profile)
    photo = read_photo(tmp_path / "a.png")
    assert photo.notes == ()
    assert np.array_equal(photo.rgb.numpy() * 255, np.asarray(oracles_io.photograph()))
