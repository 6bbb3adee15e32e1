"""Captures written byte by byte in the layouts of others, without any code under test.

One bright point moves before standing or moving cameras; each image shows it as one pixel (or a
blob), where the cameras' own formula puts it. Axes: OpenCV, world and cameras.
"""

import json
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np

GREY = 40


@dataclass(frozen=True, slots=True, kw_only=True)
class Seer:
    """A camera by its axes in the world."""

    right: np.ndarray
    down: np.ndarray
    forward: np.ndarray
    position: np.ndarray
    focal_px: tuple[float, float] = (30.0, 33.0)
    center_px: tuple[float, float] = (17.3, 11.6)
    size_px: tuple[int, int] = (24, 36)
    skew_px: float = 0.0
    radial: tuple[float, float, float] = (0.0, 0.0, 0.0)
    tangential: tuple[float, float] = (0.0, 0.0)

    def straight_px(self, point: np.ndarray) -> tuple[float, float]:
        """(x, y) in the image of a pinhole camera."""
        x, y = self._direction(point)
        return self.focal_px[0] * x + self.center_px[0], self.focal_px[1] * y + self.center_px[1]

    def seen_px(self, point: np.ndarray) -> tuple[float, float]:
        """(x, y) through the lens."""
        x, y = self._direction(point)
        (k1, k2, k3), (p1, p2) = self.radial, self.tangential
        r2 = x * x + y * y
        d = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
        xd = x * d + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
        yd = y * d + 2 * p2 * x * y + p1 * (r2 + 2 * y * y)
        u = self.focal_px[0] * xd + self.skew_px * yd + self.center_px[0]
        return u, self.focal_px[1] * yd + self.center_px[1]

    def depth(self, point: np.ndarray) -> float:
        """z."""
        return float(self.forward @ (point - self.position))

    def opengl(self) -> list[list[float]]:
        """4 × 4 world_from_camera: right, up, back, position."""
        columns = np.stack([self.right, -self.down, -self.forward, self.position], 1)
        return [*columns.tolist(), [0.0, 0.0, 0.0, 1.0]]

    def rows(self) -> np.ndarray:
        """camera_from_world rotation."""
        return np.stack([self.right, self.down, self.forward])

    def quat(self) -> np.ndarray:
        """camera_from_world, wxyz: the eigenvector method (Bar-Itzhack, 2000)."""
        m = self.rows()
        k = np.zeros((4, 4))
        k[0, 0] = np.trace(m)
        k[0, 1:] = k[1:, 0] = m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]
        k[1:, 1:] = m + m.T - np.trace(m) * np.eye(3)
        return np.linalg.eigh(k)[1][:, -1]

    def _direction(self, point: np.ndarray) -> tuple[float, float]:
        x, y, z = self.rows() @ (point - self.position)
        return x / z, y / z


def seer(angle: float, height: float = 0.4, **lens: object) -> Seer:
    """A camera on a circle of radius 4 around the origin, rolled a little."""
    position = np.array([4 * np.sin(angle), -height, -4 * np.cos(angle)])
    forward = -position / np.linalg.norm(position)
    right = np.cross([0.1, 1.0, 0.2], forward)
    right /= np.linalg.norm(right)
    return Seer(
        right=right, down=np.cross(forward, right), forward=forward, position=position, **lens
    )


def point_at(time: float) -> np.ndarray:
    """Where the bright point is."""
    return np.array([0.5 * np.cos(3 * time), 0.2 - 0.3 * time, 0.4 * np.sin(2 * time)])


def pixel_image(camera: Seer, time: float, level: int = 255) -> np.ndarray:
    """``h w 3``, uint8 RGB: grey, and the red pixel that holds the point."""
    image = np.full((*camera.size_px, 3), GREY, np.uint8)
    column, row = (int(np.floor(value)) for value in camera.seen_px(point_at(time)))
    image[row, column] = (level, 0, 0)
    return image


def side_point_at(time: float) -> np.ndarray:
    """Where the blob is: to the side, where lenses bend."""
    return 0.4 * point_at(time) + np.array([1.0, -0.6, 0.0])


def blob_image(camera: Seer, time: float, sigma_px: float = 1.3) -> np.ndarray:
    """``h w 3``, uint8 RGB: a round blob on black, exact at pixel centres."""
    height, width = camera.size_px
    column, row = camera.seen_px(side_point_at(time))
    x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    bright = np.exp(-((x - column) ** 2 + (y - row) ** 2) / (2 * sigma_px**2))
    return np.round(255 * np.stack([bright, bright, bright], -1)).astype(np.uint8)


def write_image(file: Path, rgb: np.ndarray) -> None:
    """PNG or JPEG by name; RGB or RGBA."""
    file.parent.mkdir(parents=True, exist_ok=True)
    order = cv2.COLOR_RGBA2BGRA if rgb.shape[2] == 4 else cv2.COLOR_RGB2BGR
    assert cv2.imwrite(str(file), cv2.cvtColor(rgb, order))


def write_json(file: Path, value: object) -> None:
    """As other programs do; NaN may stand in it."""
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(json.dumps(value))


def change_json(file: Path, change: object) -> None:
    """Let ``change`` work on what the file holds."""
    value = json.loads(file.read_text())
    change(value)
    write_json(file, value)


def dnerf_cameras(split: str) -> list[tuple[Seer, float]]:
    """Cameras and times of a split; the principal point is in the middle, pixels are square."""
    count, shift = {"train": (6, 0.0), "val": (2, 0.33), "test": (3, 0.57)}[split]
    lens = {"focal_px": (30.0, 30.0), "center_px": (18.0, 12.0)}
    return [(seer(shift + 0.4 * i, **lens), i / (count - 1)) for i in range(count)]


def write_dnerf(
    folder: Path, splits: tuple[str, ...] = ("train", "val", "test"), alpha: bool = True
) -> Path:
    """D-NeRF; with ``alpha`` everything but the point is transparent black."""
    for split in splits:
        frames = []
        for index, (camera, time) in enumerate(dnerf_cameras(split)):
            rgb = pixel_image(camera, time)
            if alpha:
                solid = (rgb[..., :1] == 255).astype(np.uint8)
                rgb = np.concatenate([rgb * solid, solid * 255], -1)
            write_image(folder / split / f"r_{index:03d}.png", rgb)
            frames.append(
                {
                    "file_path": f"./{split}/r_{index:03d}",
                    "rotation": 0.1,
                    "time": time,
                    "transform_matrix": camera.opengl(),
                }
            )
        angle = 2 * np.arctan(18.0 / 30.0)
        write_json(folder / f"transforms_{split}.json", {"camera_angle_x": angle, "frames": frames})
    return folder


def rig_cameras(count: int = 4, **lens: object) -> list[Seer]:
    """Standing cameras side by side."""
    return [seer(-0.4 + 0.25 * index, **lens) for index in range(count)]


def llff_rows(cameras: list[Seer], full: int = 2) -> np.ndarray:
    """``poses_bounds.npy`` for images ``full`` times as large."""
    rows = []
    for camera in cameras:
        height, width = (side * full for side in camera.size_px)
        intrinsics = [height, width, camera.focal_px[0] * full]
        columns = [camera.down, camera.right, -camera.forward, camera.position, intrinsics]
        rows.append([*np.stack(columns, 1).ravel(), 1.0, 9.0])
    return np.array(rows)


def write_neu3d(folder: Path, frames: int = 3, count: int = 4) -> list[Seer]:
    """Neural 3D Video as extracted images of half the size; returns the cameras."""
    cameras = rig_cameras(count, focal_px=(31.0, 31.0), center_px=(18.0, 12.0))
    for number, camera in enumerate(cameras):
        for frame in range(frames):
            image = pixel_image(camera, frame / 30)
            write_image(folder / f"cam{number:02d}" / "images" / f"{frame:04d}.png", image)
    np.save(folder / "poses_bounds.npy", llff_rows(cameras))
    return cameras


def write_video(file: Path, images: list[np.ndarray], fps: float) -> None:
    """An mp4 of few colours' loss."""
    height, width, _ = images[0].shape
    file.parent.mkdir(parents=True, exist_ok=True)
    stream = cv2.VideoWriter(str(file), cv2.VideoWriter_fourcc(*"mp4v"), fps, (width, height))
    assert stream.isOpened()
    for image in images:
        stream.write(cv2.cvtColor(image, cv2.COLOR_RGB2BGR))
    stream.release()


def nerfies_camera_json(camera: Seer, full: int = 2, center: object = 0.0, scale: float = 1.0):
    """For images ``full`` times as large, in a world before centre and scale were applied."""
    return {
        "orientation": camera.rows().tolist(),
        "position": (camera.position / scale + np.asarray(center)).tolist(),
        "focal_length": camera.focal_px[0] * full,
        "principal_point": [value * full for value in camera.center_px],
        "skew": camera.skew_px * full,
        "pixel_aspect_ratio": camera.focal_px[1] / camera.focal_px[0],
        "radial_distortion": list(camera.radial),
        "tangential_distortion": list(camera.tangential),
        "image_size": [camera.size_px[1] * full, camera.size_px[0] * full],
    }


NERFIES_CENTER, NERFIES_SCALE = (1.5, -2.0, 3.0), 0.25


def write_hypernerf(
    folder: Path, count: int = 8, validation: bool = True, draw: object = pixel_image, **lens
) -> list[Seer]:
    """Two cameras side by side that move along; images at 2x; returns left, right, left, ..."""
    cameras, ids, metadata = [], [], {}
    for index in range(2 * count):
        warp, side = divmod(index, 2)
        camera = replace(seer(0.1 * warp + 0.3 * side), **lens)
        name = f"{'left' if side == 0 else 'right'}1_{warp:06d}"
        write_json(
            folder / "camera" / f"{name}.json",
            nerfies_camera_json(camera, 2, NERFIES_CENTER, NERFIES_SCALE),
        )
        write_image(folder / "rgb" / "2x" / f"{name}.png", draw(camera, warp / 15))
        metadata[name] = {"warp_id": warp, "appearance_id": warp, "camera_id": side}
        cameras.append(camera)
        ids.append(name)
    write_json(folder / "metadata.json", metadata)
    write_json(
        folder / "dataset.json",
        {
            "count": len(ids),
            "num_exemplars": count,
            "ids": ids,
            "train_ids": ids[::2] if validation else ids,
            "val_ids": ids[1::2] if validation else [],
        },
    )
    write_json(
        folder / "scene.json",
        {"scale": NERFIES_SCALE, "center": list(NERFIES_CENTER), "near": 0.1, "far": 2.0},
    )
    points = np.stack([point_at(0.1 * index) for index in range(5)])
    np.save(folder / "points.npy", points / NERFIES_SCALE + NERFIES_CENTER)
    return cameras


def write_transforms(
    folder: Path, count: int = 16, draw: object = pixel_image, **lens: object
) -> list[Seer]:
    """nerfstudio, one camera that moves, an image every tenth of a second."""
    cameras = [seer(0.06 * index, **lens) for index in range(count)]
    frames = []
    for index, camera in enumerate(cameras):
        name = f"images/frame_{index + 1:05d}.png"
        write_image(folder / name, draw(camera, index / 10))
        frames.append({"file_path": name, "transform_matrix": camera.opengl(), "time": index / 10})
    first = cameras[0]
    write_json(
        folder / "transforms.json",
        {
            "camera_model": "OPENCV",
            **{"fl_x": first.focal_px[0], "fl_y": first.focal_px[1]},
            **{"cx": first.center_px[0], "cy": first.center_px[1]},
            **{"w": first.size_px[1], "h": first.size_px[0]},
            **{"k1": first.radial[0], "k2": first.radial[1]},
            **{"p1": first.tangential[0], "p2": first.tangential[1]},
            "frames": frames,
        },
    )
    return cameras
