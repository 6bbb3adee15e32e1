"""``camera_path.json`` of the nerfstudio viewer and its render command.

Axes: ``t`` frames. ``camera_to_world`` holds 16 numbers row by row, OpenGL camera axes; ``fov`` is
the vertical field of view in degrees of a centred camera with square pixels; ``render_time`` in
[0, 1] is the share of ``seconds`` at which a moving scene is shown. Files without it play at
``fps`` (nerfstudio, cameras/camera_paths.py).
"""

import json
import math

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.errors import FileFormatError, InputError
from diff4splat.geometry.camera import Camera
from diff4splat.paths.camera_path import CameraPath
from diff4splat.paths.formats.axes import swap_opengl_opencv
from diff4splat.paths.formats.checks import checked_path, exact_poses
from diff4splat.paths.formats.json_fields import (
    FrameRecord,
    frame_records,
    image_size,
    load_object,
    number_for_all,
    numbers,
    optional_number,
)
from diff4splat.paths.formats.source import DEFAULT_FPS, PathSource
from diff4splat.paths.messages import quoted
from diff4splat.paths.resize import fitted


def parse(text: str, source: PathSource) -> CameraPath:
    """Poses as in the file (its world, OpenCV camera axes), float64.

    Raises:
        FileFormatError: naming the frame, counted from 0.
    """
    root = load_object(text, source.name)
    _require_perspective(root, source.name)
    frames = frame_records(root, "camera_path", source.name)
    labels = [frame.label for frame in frames]
    size_px = image_size(root, ("render_height", "render_width"), source.name)
    view = fitted(source.view.to(torch.float64), size_px or source.view.size_px)
    poses = exact_poses(_matrices(frames), labels, source.name)
    focals = [_focal_px(frame, view) for frame in frames]
    middle = poses.new_tensor([view.size_px[1] / 2, view.size_px[0] / 2])
    cameras = Camera(
        focal_px=torch.tensor(focals, dtype=torch.float64),
        center_px=middle.expand(len(frames), 2),
        world_from_camera=swap_opengl_opencv(poses),
        size_px=view.size_px,
    )
    return checked_path(cameras, _times_s(root, frames, source), labels, source.name)


def dump(path: CameraPath) -> str:
    """The text of a file; the first frame is at time 0.

    Raises:
        InputError: a principal point off the middle, or pixels that are not square.
    """
    cameras = path.cameras.to(torch.float64)
    _require_centered(cameras)
    height, width = cameras.size_px
    times_s = (path.times_s.double() - path.times_s[0].double()).tolist()
    fps = (len(path) - 1) / times_s[-1] if len(path) > 1 else DEFAULT_FPS
    seconds = len(path) / fps
    matrices = swap_opengl_opencv(cameras.world_from_camera).flatten(-2).tolist()
    half_fovs = torch.atan(0.5 * height / cameras.focal_px[:, 1])
    frames = [
        {
            "camera_to_world": matrix,
            "fov": fov,
            "aspect": width / height,
            "render_time": time / seconds,
        }
        for matrix, fov, time in zip(
            matrices, torch.rad2deg(2 * half_fovs).tolist(), times_s, strict=True
        )
    ]
    root = {
        "camera_type": "perspective",
        **{"render_width": width, "render_height": height, "fps": fps, "seconds": seconds},
        **{"is_cycle": False, "smoothness_value": 0, "keyframes": [], "camera_path": frames},
    }
    return json.dumps(root, indent=1) + "\n"


def _require_perspective(root: dict[str, object], name: str) -> None:
    kind = root.get("camera_type", "perspective")
    if kind != "perspective":
        raise FileFormatError(
            f"{name}: expected camera_type 'perspective', got {quoted(kind)}; "
            "render the path as perspective"
        )


def _matrices(frames: list[FrameRecord]) -> Float[Tensor, "t 4 4"]:
    flat = [numbers(frame.fields, "camera_to_world", 16, frame.where) for frame in frames]
    return torch.tensor(flat, dtype=torch.float64).unflatten(-1, (4, 4))


def _focal_px(frame: FrameRecord, view: Camera) -> tuple[float, float]:
    fov_deg = optional_number(frame.fields, "fov", frame.where)
    if fov_deg is None:
        return float(view.focal_px[0]), float(view.focal_px[1])
    if not 0 < fov_deg < 180:
        raise FileFormatError(
            f"{frame.where}: 'fov': expected vertical degrees between 0 and 180, got {fov_deg:g}; "
            "repair the file"
        )
    focal_px = 0.5 * view.size_px[0] / math.tan(math.radians(fov_deg) / 2)
    return focal_px, focal_px


def _times_s(
    root: dict[str, object], frames: list[FrameRecord], source: PathSource
) -> Float[Tensor, " t"]:
    fps = _positive(root, "fps", source.name) or source.fps
    seconds = _positive(root, "seconds", source.name) or len(frames) / fps
    shares = number_for_all(frames, "render_time", source.name)
    if shares is None:
        return torch.arange(len(frames), dtype=torch.float64) / fps
    outside = (shares < 0) | (shares > 1)
    if bool(outside.any()):
        index = int(outside.int().argmax())
        raise FileFormatError(
            f"{frames[index].where}: 'render_time': expected a share of the duration from 0 to 1, "
            f"got {float(shares[index]):g}; divide by 'seconds'"
        )
    return shares * seconds


def _positive(root: dict[str, object], key: str, name: str) -> float | None:
    value = optional_number(root, key, name)
    if value is not None and value <= 0:
        raise FileFormatError(
            f"{name}: '{key}': expected a number above 0, got {value:g}; repair the file"
        )
    return value


def _require_centered(cameras: Camera) -> None:
    height, width = cameras.size_px
    offset = (cameras.center_px - cameras.center_px.new_tensor([width / 2, height / 2])).abs().max()
    skewed = (cameras.focal_px[:, 0] / cameras.focal_px[:, 1] - 1).abs().max()
    if float(offset) > 0.01 or float(skewed) > 1e-4:
        raise InputError(
            "camera_path.json: expected a principal point in the middle and square pixels, got "
            f"{float(offset):.3g} px off and {float(skewed):.2%} stretched; "
            "write transforms.json instead"
        )
