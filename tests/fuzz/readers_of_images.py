"""Photographs, OpenEXR, NumPy and videos."""

from pathlib import Path

import numpy as np
import oracles_io
import torch
from capture_folders import write_video
from PIL import Image

from diff4splat.data_prep.readers.files.depth_file import DepthFile
from diff4splat.data_prep.readers.files.image_file import ImageFile
from diff4splat.data_prep.readers.files.lru_cache import LruCache
from diff4splat.data_prep.readers.files.point_cloud import read_positions
from diff4splat.data_prep.readers.files.video_file import VideoFile
from diff4splat.io.exr import read_depth_exr, write_depth_exr
from diff4splat.io.photos.images import read_photo
from fuzz.reader import Reader, read_each

SIZE_PX = (20, 24)


def _write_photos(folder: Path) -> None:
    photo = oracles_io.photograph()
    for name in ("a.png", "a.jpg", "a.webp", "a.tif", "a.bmp", "a.avif"):
        photo.save(folder / name)
    exif = photo.getexif()
    exif[0x0112] = 6
    photo.save(folder / "turned.jpg", exif=exif)
    photo.save(folder / "animated.gif", save_all=True, append_images=[photo.rotate(90)])
    photo.save(folder / "animated.webp", save_all=True, append_images=[photo.rotate(180)])
    photo.convert("P").save(folder / "palette.png")
    photo.convert("RGBA").save(folder / "alpha.png")
    Image.fromarray(np.arange(480, dtype=np.uint16).reshape(SIZE_PX) * 99).save(folder / "deep.png")
    Image.fromarray(np.linspace(0, 1, 480, dtype="f4").reshape(SIZE_PX)).save(folder / "float.tif")


def _read_photos(folder: Path) -> None:
    read_each(folder, lambda file: read_photo(file, convert=True))
    read_photo(folder / "a.png")


def _write_exr(folder: Path) -> None:
    path = oracles_io.camera_path()
    depth = 1 + torch.rand(len(path), *path.cameras.size_px)
    write_depth_exr(depth, path, folder / "depth.exr")


def _write_numpy(folder: Path) -> None:
    rng = np.random.default_rng(0)
    np.save(folder / "image.npy", rng.random((*SIZE_PX, 3)).astype("f4"))
    np.save(folder / "levels.npy", rng.integers(0, 255, (*SIZE_PX, 4), "u1"))
    np.save(folder / "depth.npy", rng.random(SIZE_PX))
    np.save(folder / "points.npy", rng.random((5, 3)))


def _read_numpy(folder: Path) -> None:
    read_each(folder, _read_array)


def _read_array(file: Path) -> None:
    if file.stem == "depth":
        DepthFile(file=file).read(SIZE_PX)
    elif file.stem == "points":
        read_positions(file)
    else:
        image = ImageFile(file=file)
        image.size_px(), image.has_alpha(), image.read()


def _write_one_video(folder: Path) -> None:
    image = np.zeros((32, 48, 3), np.uint8)
    write_video(folder / "cam00.mp4", [image, image + 90, image + 200], 30.0)


def _read_one_video(folder: Path) -> None:
    video = VideoFile(folder / "cam00.mp4", 1, LruCache(1 << 20))
    video.read(0)
    video.read(video.frames - 1)


IMAGES = {
    "photographs": Reader(make=_write_photos, read=_read_photos),
    "depth EXR": Reader(make=_write_exr, read=lambda folder: read_depth_exr(folder / "depth.exr")),
    "NumPy": Reader(make=_write_numpy, read=_read_numpy),
    "video": Reader(make=_write_one_video, read=_read_one_video),
}
