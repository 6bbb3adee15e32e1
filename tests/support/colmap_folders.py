"""COLMAP models written with ``struct`` and text from its format page, and folders around them."""

import struct
from pathlib import Path

import numpy as np
from capture_folders import Seer, pixel_image, point_at, rig_cameras, seer, write_image

MODELS = {"SIMPLE_PINHOLE": 0, "PINHOLE": 1, "SIMPLE_RADIAL": 2, "RADIAL": 3, "OPENCV": 4}


def parameters(camera: Seer, model: str) -> list[float]:
    """As the model lists them."""
    (fx, fy), (cx, cy), (k1, k2, _) = camera.focal_px, camera.center_px, camera.radial
    return {
        "SIMPLE_PINHOLE": [fx, cx, cy],
        "PINHOLE": [fx, fy, cx, cy],
        "SIMPLE_RADIAL": [fx, cx, cy, k1],
        "RADIAL": [fx, cx, cy, k1, k2],
        "OPENCV": [fx, fy, cx, cy, k1, k2, *camera.tangential],
    }[model]


def write_binary(
    folder: Path, images: list[tuple[str, Seer]], points: np.ndarray, model: str = "PINHOLE"
) -> None:
    """cameras.bin, images.bin and points3D.bin; one camera per image."""
    folder.mkdir(parents=True, exist_ok=True)
    cameras, poses = [struct.pack("<Q", len(images))], [struct.pack("<Q", len(images))]
    for number, (name, camera) in enumerate(images, start=1):
        height, width = camera.size_px
        values = parameters(camera, model)
        cameras.append(struct.pack("<iiQQ", number, MODELS[model], width, height))
        cameras.append(struct.pack(f"<{len(values)}d", *values))
        translation = -camera.rows() @ camera.position
        poses.append(struct.pack("<I7dI", number, *camera.quat(), *translation, number))
        poses.append(name.encode() + b"\0")
        seen = [(1.5, 2.5, 7), (3.5, 4.5, -1)][: number % 3]
        poses.append(struct.pack("<Q", len(seen)))
        poses += [struct.pack("<ddq", *one) for one in seen]
    cloud = [struct.pack("<Q", len(points))]
    for number, point in enumerate(points, start=1):
        cloud.append(struct.pack("<Q3d3Bd", number, *point, 255, 51, 0, 0.5))
        cloud.append(struct.pack("<Q", number) + struct.pack("<ii", 1, 0) * number)
    for name, parts in (("cameras", cameras), ("images", poses), ("points3D", cloud)):
        (folder / f"{name}.bin").write_bytes(b"".join(parts))


def write_text(
    folder: Path, images: list[tuple[str, Seer]], points: np.ndarray, model: str = "PINHOLE"
) -> None:
    """The same as text; every other image has an empty line of 2D points."""
    folder.mkdir(parents=True, exist_ok=True)
    cameras, poses = ["# Camera list"], ["# Image list", "#   POINTS2D[] as (X, Y, POINT3D_ID)"]
    for number, (name, camera) in enumerate(images, start=1):
        values = " ".join(repr(float(value)) for value in parameters(camera, model))
        height, width = camera.size_px
        cameras.append(f"{number} {model} {width} {height} {values}")
        pose = [*camera.quat(), *(-camera.rows() @ camera.position)]
        numbers = " ".join(repr(float(value)) for value in pose)
        poses += [f"{number} {numbers} {number} {name}", "1.5 2.5 7" if number % 2 else ""]
    cloud = ["# 3D point list"]
    for number, point in enumerate(points, start=1):
        position = " ".join(repr(float(value)) for value in point)
        cloud.append(f"{number} {position} 255 51 0 0.5 1 0")
    for name, lines in (("cameras", cameras), ("images", poses), ("points3D", cloud)):
        (folder / f"{name}.txt").write_text("\n".join(lines) + "\n")


def cloud() -> np.ndarray:
    """Points to start from."""
    return np.stack([point_at(0.2 * index) for index in range(4)])


def write_rig(
    folder: Path, count: int = 4, frames: int = 3, sparse: str = "sparse_", text: bool = False
) -> list[Seer]:
    """The layout of several cameras: cam01/frame_00001.jpg and a model of image1.jpg and so on."""
    cameras = rig_cameras(count)
    for number, camera in enumerate(cameras, start=1):
        for frame in range(frames):
            file = folder / f"cam{number:02d}" / f"frame_{frame + 1:05d}.png"
            write_image(file, pixel_image(camera, frame / 30))
    named = [(f"image{number}.jpg", camera) for number, camera in enumerate(cameras, start=1)]
    # COLMAP does not keep any order.
    (write_text if text else write_binary)(folder / sparse, named[::-1], cloud())
    return cameras


def write_moving(folder: Path, count: int = 12, text: bool = False) -> list[Seer]:
    """One camera that moves, whose fourth image has no pose; returns all cameras."""
    cameras = [seer(0.08 * index) for index in range(count)]
    for index, camera in enumerate(cameras):
        write_image(folder / "images" / f"frame_{index}.png", pixel_image(camera, index / 30))
    named = [(f"frame_{index}.png", camera) for index, camera in enumerate(cameras) if index != 3]
    (write_text if text else write_binary)(folder / "sparse" / "0", named, cloud())
    return cameras
