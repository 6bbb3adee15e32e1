"""Small scenes, images and an independent PLY reader for the tests of files.

The committed scene file is made again, after a deliberate change of the format, by:
    PYTHONPATH=tests/support python -c "import oracles_io; oracles_io.write_golden()"
"""

import struct
from pathlib import Path

import torch
from PIL import Image

from diff4splat.geometry.camera import pinhole
from diff4splat.io.scene_files.scene_file import save_scene
from diff4splat.paths.camera_path import CameraPath
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.keyframes import KeyframeMotion
from diff4splat.scene.motion.static import StaticMotion
from diff4splat.scene.scene import Provenance, Scene

PLY_CORE = (
    *("x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity"),
    *("scale_0", "scale_1", "rot_0", "rot_1", "rot_2", "rot_3"),
)
"""The properties without which a PLY does not hold Gaussians."""
GOLDEN = Path(__file__).parents[1] / "golden" / "scene_v1.safetensors"


def ramp(*shape: int, dtype: torch.dtype = torch.float32) -> torch.Tensor:
    """Multiples of 1/64: exact in every floating-point type, and the same on every machine."""
    count = int(torch.tensor(shape).prod())
    return (torch.arange(count, dtype=dtype) / 64).reshape(shape)


def gaussians(n: int = 4, k: int = 4, dtype: torch.dtype = torch.float32) -> Gaussians:
    """Plain, distinct values; quaternions of unit length."""
    quats = torch.tensor([[1, 0, 0, 0], [0.5, 0.5, 0.5, 0.5]], dtype=dtype).repeat(n, 1)[:n]
    return Gaussians(
        means=ramp(n, 3, dtype=dtype) - 0.25,
        quats=quats,
        scales=ramp(n, 3, dtype=dtype) + 0.125,
        opacities=(ramp(n, dtype=dtype) + 0.25).clamp_max(1),
        sh=ramp(n, k, 3, dtype=dtype) - 0.5,
    )


def camera_path(
    frames: int = 2, size_px: tuple[int, int] = (6, 8), dtype: torch.dtype = torch.float32
) -> CameraPath:
    """A camera that moves to the right, starting at the identity."""
    poses = torch.eye(4, dtype=dtype).repeat(frames, 1, 1)
    poses[:, 0, 3] = ramp(frames, dtype=dtype)
    cameras = pinhole(10.0, size_px, dtype).with_pose(poses)
    return CameraPath(cameras=cameras, times_s=torch.arange(frames, dtype=dtype) / 4)


def keyframe_motion(dtype: torch.dtype = torch.float32) -> KeyframeMotion:
    """Gaussians 1 and 3 move over three keys."""
    half = torch.tensor([0.5, 0.5, 0.5, 0.5], dtype=dtype)
    return KeyframeMotion(
        key_times_s=torch.tensor([0.0, 0.5, 2.0], dtype=dtype),
        moving_index=torch.tensor([1, 3]),
        offsets=ramp(3, 2, 3, dtype=dtype),
        rotations=half.expand(3, 2, 4).clone(),
        log_scale_offsets=ramp(3, 2, 3, dtype=dtype) - 0.125,
        interpolation="cubic",
    )


def scene(moving: bool = True, dtype: torch.dtype = torch.float32, k: int = 4) -> Scene:
    """Four Gaussians with everything that a scene file can hold."""
    return Scene(
        gaussians=gaussians(4, k, dtype),
        motion=keyframe_motion(dtype) if moving else StaticMotion(time_range_s=(0.0, 2.0)),
        path=camera_path(dtype=dtype),
        provenance=Provenance(
            generator="diff4splat test",
            model="small",
            weights_sha256="0" * 64,
            seed=7,
            prompt="ein Glas Tee, grün",
            license="CC0-1.0",
            untrained=True,
        ),
    )


def write_golden() -> None:
    """Make the committed scene file again."""
    save_scene(scene(), GOLDEN)


def photograph(width: int = 24, height: int = 20) -> Image.Image:
    """An image whose four corners differ, so that every turn of it can be told."""
    image = Image.new("RGB", (width, height))
    image.putdata(
        [(10 * x % 256, 12 * y % 256, (x * y) % 256) for y in range(height) for x in range(width)]
    )
    return image


def read_ply_plainly(data: bytes) -> tuple[list[str], list[str], list[dict[str, float]]]:
    """Comments, property names and rows of a little-endian PLY that has only floats."""
    text, body = data.split(b"end_header\n", 1)
    lines = text.decode("ascii").splitlines()
    comments = [line.removeprefix("comment ") for line in lines if line.startswith("comment ")]
    names = [line.split()[2] for line in lines if line.startswith("property float ")]
    rows = struct.iter_unpack(f"<{len(names)}f", body)
    return comments, names, [dict(zip(names, row, strict=True)) for row in rows]
