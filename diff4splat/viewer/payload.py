"""Everything that the page needs of a scene: one JSON header, and compressed bytes.

Axes: ``n`` Gaussians, of which the first ``m`` move, ``t`` key times, ``k`` harmonics. The header
lists the sections of the bytes in order.
"""

import gzip
from dataclasses import dataclass, field

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.errors import InputError
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.keyframes import KeyframeMotion
from diff4splat.scene.motion.static import StaticMotion
from diff4splat.scene.scene import Scene
from diff4splat.viewer.quantise import (
    byte_planes,
    components,
    float24,
    log_scales,
    range16,
    smallest_three,
)

LEAST_OPACITY = 1 / 255
"""Renderers draw nothing below it."""
SH_DC = 0.28209479177387814
BYTES_PER_GAUSSIAN, BYTES_PER_KEY = 23, 19
MAX_BYTES = 380_000_000
"""Before compression. A browser's longest string holds about 500 million characters, and base64
needs four for three bytes."""


@dataclass(slots=True)
class Payload:
    """Header and bytes, while they are collected."""

    header: dict[str, object] = field(default_factory=dict)
    sections: list[tuple[str, bytes]] = field(default_factory=list)

    def add(self, name: str, data: bytes) -> None:
        """One section."""
        self.sections.append((name, data))

    @property
    def bytes(self) -> bytes:
        """All sections, compressed; equal scenes give equal bytes."""
        return gzip.compress(b"".join(data for _, data in self.sections), 6, mtime=0)

    @property
    def full_header(self) -> dict[str, object]:
        """With the length of every section."""
        return self.header | {"sections": [[name, len(data)] for name, data in self.sections]}


def pack_scene(scene: Scene) -> Payload:
    """The scene as the page reads it; its motion is static or key-framed."""
    drawn = scene.gaussians.opacities >= LEAST_OPACITY
    scene = _moving_first(scene.select(drawn))
    payload, path = Payload(), scene.path
    payload.header |= {
        "count": len(scene.gaussians),
        "moving": 0,
        "time_range_s": list(scene.motion.time_range_s),
        "dilation_px2": scene.dilation_px2,
        "size_px": list(path.cameras.size_px),
        "path": _path_header(scene),
    }
    _pack_gaussians(payload, scene.gaussians)
    if isinstance(scene.motion, KeyframeMotion):
        _pack_motion(payload, scene.motion)
    return payload


def require_page_size(scene: Scene) -> None:
    """Refuse a scene whose page no browser could open.

    Raises:
        InputError: it is too large.
    """
    motion, harmonics = scene.motion, scene.gaussians.sh.shape[1] - 1
    size = len(scene.gaussians) * (BYTES_PER_GAUSSIAN + 3 * harmonics)
    if isinstance(motion, KeyframeMotion):
        size += len(motion.key_times_s) * len(motion.moving_index) * BYTES_PER_KEY
    if size > MAX_BYTES:
        raise InputError(
            f"HTML page: expected a scene of at most {MAX_BYTES / 1e6:.0f} MB before compression, "
            f"got {len(scene.gaussians):,} Gaussians with {size / 1e6:.0f} MB; "
            "make it with fewer Gaussians or key times, or render a video"
        )


def _moving_first(scene: Scene) -> Scene:
    """The same scene with the Gaussians that move at the front."""
    motion = scene.motion
    if isinstance(motion, StaticMotion):
        return scene
    moves = torch.zeros(len(scene.gaussians), dtype=torch.bool)
    moves[motion.moving_index] = True
    order = torch.cat([motion.moving_index, (~moves).nonzero()[:, 0]])
    count = len(motion.moving_index)
    return Scene(
        gaussians=scene.gaussians.select(order),
        motion=KeyframeMotion(
            key_times_s=motion.key_times_s,
            moving_index=torch.arange(count),
            offsets=motion.offsets,
            rotations=motion.rotations,
            log_scale_offsets=motion.log_scale_offsets,
            interpolation=motion.interpolation,
        ),
        path=scene.path,
        provenance=scene.provenance,
        dilation_px2=scene.dilation_px2,
    )


def _path_header(scene: Scene) -> dict[str, object]:
    cameras = scene.path.cameras
    return {
        "focal_px": _rounded(cameras.focal_px),
        "center_px": _rounded(cameras.center_px),
        "world_from_camera": _rounded(cameras.world_from_camera[:, :3].flatten(1)),
        "times_s": _rounded(scene.path.times_s),
    }


def _pack_gaussians(payload: Payload, gaussians: Gaussians) -> None:
    payload.add("means", float24(_numpy(gaussians.means)))
    payload.add("log_scales", byte_planes(log_scales(_numpy(gaussians.scales))))
    payload.add("quats", byte_planes(smallest_three(_numpy(gaussians.quats))))
    rgb = 0.5 + SH_DC * _numpy(gaussians.sh)[:, 0]
    low = rgb.min(0, initial=0.0)
    high = rgb.max(0, initial=1.0)
    payload.header["color_range"] = [low.tolist(), high.tolist()]
    payload.add("colors", _uint8((rgb - low) / (high - low)))
    payload.add("opacities", _uint8(_numpy(gaussians.opacities)))
    harmonics = _numpy(gaussians.sh)[:, 1:]
    payload.header["harmonics"] = harmonics.shape[1]
    if harmonics.size:
        # The page reads four signed bytes at a time.
        largest = float(np.abs(harmonics).max()) or 1.0
        payload.header["harmonics_step"] = largest / 127
        payload.add("harmonics", np.rint(harmonics / largest * 127).astype(np.int8).tobytes())


def _pack_motion(payload: Payload, motion: KeyframeMotion) -> None:
    offsets, scales = range16(_numpy(motion.offsets)), range16(_numpy(motion.log_scale_offsets))
    payload.header |= {
        "moving": len(motion.moving_index),
        "key_times_s": _rounded(motion.key_times_s),
        "interpolation": motion.interpolation,
        "offset_step": offsets.step,
        "log_scale_step": scales.step,
    }
    payload.add("offsets", byte_planes(_changes(offsets.values)))
    packed = smallest_three(_numpy(motion.rotations))
    payload.add("rotation_largest", byte_planes((packed >> 30).astype(np.uint8)))
    payload.add("rotation_components", byte_planes(_changes(components(packed))))
    payload.add("log_scale_offsets", byte_planes(_changes(scales.values)))


def _changes(values: np.ndarray) -> np.ndarray:
    """Differences of differences from key to key, modulo 2¹⁶: even motion has none."""
    first = np.diff(values.view(np.uint16), axis=0, prepend=np.uint16(0))
    return np.diff(first, axis=0, prepend=np.uint16(0))


def _uint8(values: Float[np.ndarray, "*n"]) -> bytes:
    return np.rint(np.clip(values, 0, 1) * 255).astype(np.uint8).tobytes()


def _numpy(tensor: Tensor) -> np.ndarray:
    return tensor.detach().cpu().float().numpy()


def _rounded(tensor: Tensor) -> list[object]:
    """As JSON, with the seven digits that 32-bit floats have."""
    return np.vectorize(lambda value: float(f"{value:.7g}"), otypes=[float])(
        tensor.detach().cpu().double().numpy()
    ).tolist()
