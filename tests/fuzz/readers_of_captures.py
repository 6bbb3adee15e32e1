"""Captures of every format; the first and the last image are decoded too."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import capture_folders
import colmap_folders
import numpy as np
import torch
from capture_folders import change_json, write_image
from clip_shards import write_shards
from filmed_scenes import filmed_scene

from diff4splat.data_prep.readers.options import ReadOptions
from diff4splat.data_prep.readers.registry import read_capture
from diff4splat.geometry.lenses.build import fisheye_camera
from diff4splat.geometry.lenses.opencv_fisheye import OpenCVFisheye
from diff4splat.geometry.optics import Aperture, Optics, Shutter
from diff4splat.io.cameras.camera_record import CameraRecord, FrameFiles, write_camera_record
from diff4splat.paths.physical_path import filmed
from diff4splat.render.physical.settings import PhotoSettings
from diff4splat.scene.scene import Provenance
from fuzz.reader import Reader


def _read(folder: Path, options: ReadOptions) -> None:
    capture = read_capture(folder / "capture", options)
    capture.frames.read(0)
    capture.frames.read(len(capture) - 1)


def _hypernerf(folder: Path) -> None:
    capture_folders.write_hypernerf(folder, count=3)


def _nerfstudio(folder: Path) -> None:
    """With a mask, depth, points and a split."""
    capture_folders.write_transforms(folder, count=4)
    mask = np.full((24, 36, 3), 255, np.uint8)
    write_image(folder / "masks" / "0.png", mask)
    np.save(folder / "depth.npy", np.ones((24, 36), "f4"))
    (folder / "points.ply").write_text(
        "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n"
        "property float z\nend_header\n0 0 1\n"
    )
    change_json(folder / "transforms.json", _with_extras)


def _with_extras(root: dict) -> None:
    root["ply_file_path"] = "points.ply"
    root["frames"][0] |= {"mask_path": "masks/0.png", "depth_file_path": "depth.npy"}
    root["val_filenames"] = [root["frames"][1]["file_path"]]


def _videos(folder: Path) -> None:
    cameras = capture_folders.rig_cameras(2, focal_px=(31.0, 31.0), center_px=(18.0, 12.0))
    for number, camera in enumerate(cameras):
        images = [capture_folders.pixel_image(camera, frame / 30) for frame in range(2)]
        capture_folders.write_video(folder / f"cam{number:02d}.mp4", images, 30.0)
    np.save(folder / "poses_bounds.npy", capture_folders.llff_rows(cameras, 1))


def _cameras(folder: Path) -> None:
    """A fisheye with everything."""
    path = filmed_scene(3).path.to(torch.float64)
    lens = OpenCVFisheye(coefficients=torch.zeros(4, dtype=torch.float64), max_angle_rad=1.5)
    camera = fisheye_camera(15.0, path.cameras.size_px, lens, torch.float64)
    camera = camera.with_pose(path.cameras.world_from_camera)
    optics = Optics(
        lens=lens,
        aperture=Aperture(radius=0.05, focus_distance=2.0),
        shutter=Shutter(readout_s=0.03),
        exposure_s=0.05,
    )
    record = CameraRecord(
        effect="bent",
        physical_path=filmed(replace(path, cameras=camera), optics),
        frames=tuple(FrameFiles(image=f"{index}.png") for index in range(3)),
        geometry="depth",
        settings=PhotoSettings(samples=2),
        scene=Provenance(generator="fuzz"),
        generator="fuzz",
        valid="valid.png",
    )
    for name in (*(frame.image for frame in record.frames), "valid.png"):
        write_image(folder / name, np.full((10, 12, 3), 200, np.uint8))
    write_camera_record(record, folder / "camera.json")


def _clips(folder: Path) -> None:
    write_shards(folder, still=0, moving=1)


def _dnerf(folder: Path) -> None:
    capture_folders.write_dnerf(folder)
    for split in ("train", "val", "test"):
        change_json(folder / f"transforms_{split}.json", _shorten)


def _shorten(root: dict) -> None:
    del root["frames"][2:]


_FORMATS = {
    "capture D-NeRF": (_dnerf, "dnerf"),
    "capture Neu3D": (lambda folder: capture_folders.write_neu3d(folder, 2, 2), "neu3d"),
    "capture Neu3D videos": (_videos, "neu3d"),
    "capture HyperNeRF": (_hypernerf, "hypernerf"),
    "capture COLMAP text": (partial(colmap_folders.write_moving, count=5, text=True), "colmap"),
    "capture COLMAP binary": (partial(colmap_folders.write_moving, count=5), "colmap"),
    "capture COLMAP rig": (partial(colmap_folders.write_rig, count=2, frames=2), "colmap"),
    "capture nerfstudio": (_nerfstudio, "transforms"),
    "capture cameras": (_cameras, "cameras"),
    "capture clips": (_clips, "clips"),
}


def _made(write: Callable[[Path], object], folder: Path) -> None:
    (folder / "capture").mkdir()
    write(folder / "capture")


CAPTURES = {
    name: Reader(make=partial(_made, write), read=partial(_read, options=ReadOptions(format=form)))
    for name, (write, form) in _FORMATS.items()
}
