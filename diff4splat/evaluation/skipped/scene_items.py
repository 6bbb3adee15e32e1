"""Items of a scene that is rendered: motion, harmonics, depth, and Gaussians nobody sees.

Axes: ``n`` Gaussians, ``k`` key times.
"""

from collections.abc import Collection, Iterator, Mapping
from dataclasses import fields, is_dataclass, replace

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.evaluation.skipped.measurement import Frames, Item
from diff4splat.geometry.camera import project
from diff4splat.render.api import render, render_video
from diff4splat.scene.harmonics import BAND_SIZES
from diff4splat.scene.motion.keyframes import KeyframeMotion
from diff4splat.scene.motion.static import StaticMotion
from diff4splat.scene.scene import Scene

TRANSPARENT = 1 / 255
"""Opacity below which renderers draw nothing."""
REACH_SIGMAS = 4.0
"""How far a Gaussian reaches beyond its mean: at 1/255 it is 3.33 deviations."""
KEYS = 5


def scene_items(scene: Scene) -> Iterator[Item]:
    """Everything that can be left out while this scene is rendered."""
    gaussians = scene.gaussians

    def lean() -> Frames:
        return film(scene)

    for name, wider in wider_scenes(scene):
        yield Item(
            name=name,
            full=lambda wider=wider: film(wider),
            lean=lean,
            saved_bytes=scene_bytes(wider) - scene_bytes(scene),
        )
    yield Item(
        name="depth",
        full=lambda: film(scene, ("rgb", "depth")),
        lean=lean,
        saved_bytes=depth_bytes(scene),
    )
    for name, kept in (
        ("transparent Gaussians", gaussians.opacities >= TRANSPARENT),
        ("invisible Gaussians", in_view(scene)),
    ):
        fewer = scene.select(kept)
        yield Item(
            name=name,
            full=lean,
            lean=lambda fewer=fewer: film(fewer),
            saved_bytes=scene_bytes(scene) - scene_bytes(fewer),
        )
    yield from repeated_items(scene)


def wider_scenes(scene: Scene) -> Iterator[tuple[str, Scene]]:
    """(what is left out, the scene with it): the same frames from more numbers."""
    if not len(scene.motion.moving_index):
        keyed = replace(scene, motion=zero_motion(scene))
        yield "deformation and key times of a static scene", keyed
    elif isinstance(scene.motion, KeyframeMotion):
        yield "key times of static Gaussians", replace(scene, motion=all_keyed(scene))
    if scene.gaussians.degree == 0:
        sh = padded(scene.gaussians.sh)
        yield "harmonics", replace(scene, gaussians=replace(scene.gaussians, sh=sh))


def repeated_items(scene: Scene) -> Iterator[Item]:
    """Frames and states that repeat: after the end of the motion, or almost at the same time."""
    view, (start_s, stop_s) = scene.path.cameras[0], scene.motion.time_range_s
    after_s = [stop_s + step for step in (0.0, 0.5, 1.0, 1.5)]
    first = render(scene, view, stop_s).rgb
    yield Item(
        name="frames out of range",
        full=lambda: [render(scene, view, time_s).rgb for time_s in after_s],
        lean=lambda: [render(scene, view, stop_s).rgb] * len(after_s),
        saved_bytes=first.nbytes * (len(after_s) - 1),
    )
    near_s = [start_s + step * 1e-3 for step in range(4)]
    state = scene.state_at(start_s)
    frozen = replace(scene, gaussians=state, motion=StaticMotion())
    yield Item(
        name="near-duplicate states",
        full=lambda: [render(scene, view, time_s).rgb for time_s in near_s],
        lean=lambda: [render(frozen, view).rgb] * len(near_s),
        saved_bytes=tensor_bytes(state) * (len(near_s) - 1),
    )


def scene_bytes(scene: Scene) -> int:
    """Of all tensors of the Gaussians and their motion."""
    return tensor_bytes(scene.gaussians) + tensor_bytes(scene.motion)


def tensor_bytes(holder: object) -> int:
    """Of all tensors in a dataclass, a module or a list of them."""
    if isinstance(holder, Tensor):
        return holder.nbytes
    if isinstance(holder, torch.nn.Module):
        return sum(tensor.nbytes for tensor in holder.state_dict().values())
    if is_dataclass(holder):
        return sum(tensor_bytes(getattr(holder, entry.name)) for entry in fields(holder))
    if isinstance(holder, Mapping):
        return sum(map(tensor_bytes, holder.values()))
    return sum(map(tensor_bytes, holder)) if isinstance(holder, (list, tuple)) else 0


def depth_bytes(scene: Scene) -> int:
    """Of the depth of all frames."""
    frames = render_video(scene, scene.path, outputs=("depth",))
    return sum(frame.depth.nbytes for frame in frames)


def film(scene: Scene, outputs: Collection[str] = ("rgb",)) -> Frames:
    """Frames along the scene's own path."""
    return [frame.rgb for frame in render_video(scene, scene.path, outputs=outputs)]


def film_singly(scene: Scene, outputs: Collection[str] = ("rgb",)) -> Frames:
    """The same, each frame for itself: nothing is kept from one to the next."""
    pairs = zip(range(len(scene.path)), scene.path.times_s.tolist(), strict=True)
    return [
        render(scene, scene.path.cameras[k], time_s, outputs=outputs).rgb for k, time_s in pairs
    ]


def zero_motion(scene: Scene) -> KeyframeMotion:
    """Key frames for every Gaussian, in which none moves."""
    start_s, stop_s = scene.motion.time_range_s
    times_s = torch.linspace(start_s, max(stop_s, start_s + 1e-3), KEYS)
    zeros = torch.zeros(KEYS, len(scene.gaussians), 3)
    return KeyframeMotion(
        key_times_s=times_s,
        moving_index=torch.arange(len(scene.gaussians)),
        offsets=zeros,
        rotations=_identity(KEYS, len(scene.gaussians)),
        log_scale_offsets=zeros,
    )


def all_keyed(scene: Scene) -> KeyframeMotion:
    """The same motion with key frames for the static Gaussians too."""
    motion, count = scene.motion, len(scene.gaussians)
    keys, index = len(motion.key_times_s), motion.moving_index
    full = {
        "offsets": torch.zeros(keys, count, 3),
        "rotations": _identity(keys, count),
        "log_scale_offsets": torch.zeros(keys, count, 3),
    }
    for name, tensor in full.items():
        tensor[:, index] = getattr(motion, name)
    return replace(motion, moving_index=torch.arange(count), **full)


def padded(sh: Float[Tensor, "n c 3"]) -> Float[Tensor, "n 16 3"]:
    """Zeros up to degree 3."""
    return torch.cat([sh, sh.new_zeros(len(sh), BAND_SIZES[3] - sh.shape[1], 3)], 1)


def in_view(scene: Scene) -> Bool[Tensor, " n"]:
    """Gaussians that reach into any frame of the path."""
    found = torch.zeros(len(scene.gaussians), dtype=torch.bool)
    for k, time_s in enumerate(scene.path.times_s.tolist()):
        state, camera = scene.state_at(time_s), scene.path.cameras[k].to(torch.float32)
        position, depth = project(camera, state.means)
        reach = REACH_SIGMAS * state.scales.amax(-1)
        rim = reach * camera.focal_px.max() / depth.clamp_min(1e-3) + REACH_SIGMAS
        height, width = camera.size_px
        inside = (position >= -rim[:, None]) & (
            position <= rim[:, None] + position.new_tensor([width, height])
        )
        found |= (inside.all(-1) & (depth > 0)) | (depth.abs() <= reach)
    return found


def _identity(keys: int, count: int) -> Float[Tensor, "k n 4"]:
    return torch.tensor([1.0, 0.0, 0.0, 0.0]).expand(keys, count, 4).clone()
