"""``transforms.json`` of nerfstudio, instant-ngp and D-NeRF.

Axes: ``t`` frames. ``transform_matrix`` is a 4×4 world_from_camera with OpenGL camera axes.
Intrinsics in pixels (fl_x fl_y cx cy w h) stand in each frame or once for all; ``camera_angle_x``
is the horizontal field of view in radians. ``time`` is taken as seconds; files without it play at a
frame rate (https://docs.nerf.studio/quickstart/data_conventions.html).
"""

import json
from collections import ChainMap

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.errors import FileFormatError
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
    number_list,
)
from diff4splat.paths.formats.pinhole_fields import pinhole_px
from diff4splat.paths.formats.source import PathSource
from diff4splat.paths.resize import fitted

_LENS = ("fl_x", "fl_y", "cx", "cy")


def parse(text: str, source: PathSource) -> CameraPath:
    """Poses as in the file (its world, OpenCV camera axes), float64.

    Raises:
        FileFormatError: naming the frame, counted from 0.
    """
    root = load_object(text, source.name)
    frames = frame_records(root, "frames", source.name)
    labels = [frame.label for frame in frames]
    matrices = torch.tensor([pose_matrix(frame) for frame in frames], dtype=torch.float64)
    poses = swap_opengl_opencv(exact_poses(matrices, labels, source.name))
    times_s = number_for_all(frames, "time", source.name)
    if times_s is None:
        times_s = torch.arange(len(frames), dtype=torch.float64) / source.fps
    return checked_path(_cameras(root, frames, poses, source), times_s, labels, source.name)


def dump(path: CameraPath) -> str:
    """The text of a file: everything a camera path holds, to the last bit of float64."""
    cameras = path.cameras.to(torch.float64)
    poses = swap_opengl_opencv(cameras.world_from_camera).tolist()
    lenses = torch.cat([cameras.focal_px, cameras.center_px], -1).tolist()
    frames = [
        {
            "file_path": f"images/{index:05d}.png",
            "time": time,
            **dict(zip(_LENS, lens, strict=True)),
            "transform_matrix": pose,
        }
        for index, (time, lens, pose) in enumerate(
            zip(path.times_s.double().tolist(), lenses, poses, strict=True)
        )
    ]
    height, width = cameras.size_px
    root = {"camera_model": "OPENCV", "w": width, "h": height, "frames": frames}
    return json.dumps(root, indent=1) + "\n"


def pose_matrix(frame: FrameRecord) -> list[list[float]]:
    """The four rows of ``transform_matrix``.

    Raises:
        FileFormatError: naming the frame.
    """
    where = f"{frame.where}: 'transform_matrix'"
    value = frame.fields.get("transform_matrix")
    if not isinstance(value, list) or len(value) != 4:
        got = f"{len(value)} rows" if isinstance(value, list) else "none"
        raise FileFormatError(f"{where}: expected 4 rows of 4 numbers, got {got}; repair the file")
    return [number_list(row, 4, where) for row in value]


def _cameras(
    root: dict[str, object],
    frames: list[FrameRecord],
    poses: Float[Tensor, "t 4 4"],
    source: PathSource,
) -> Camera:
    # A frame's own value goes before the one given for all.
    records = [ChainMap(frame.fields, root) for frame in frames]
    size_px = image_size(records[0], ("h", "w"), frames[0].where) or source.view.size_px
    view = fitted(source.view.to(torch.float64), size_px)
    lenses = []
    for frame, record in zip(frames, records, strict=True):
        own_size_px = image_size(record, ("h", "w"), frame.where) or size_px
        if own_size_px != size_px:
            raise FileFormatError(
                f"{frame.where}: expected the image size of the first frame, {size_px[1]} x "
                f"{size_px[0]}, got {own_size_px[1]} x {own_size_px[0]}; split the file"
            )
        lenses.append(pinhole_px(record, frame.where, view))
    lens = torch.tensor(lenses, dtype=torch.float64)
    return Camera(
        focal_px=lens[:, :2],
        center_px=lens[:, 2:],
        world_from_camera=poses,
        size_px=size_px,
    )
