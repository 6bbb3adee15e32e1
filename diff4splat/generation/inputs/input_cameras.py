"""Camera paths as the model sees them: a fixed number of cameras spread over the asked path.

The path that generates a scene and the path it is shown along differ: the first has
as many cameras as the model was made for, the second as many frames as the video.
Axes: ``h w`` pixels.
"""

from dataclasses import replace

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.generation.inputs.input_image import InputImage
from diff4splat.geometry.camera import Camera
from diff4splat.geometry.rays import relative_to_first
from diff4splat.models.ldrm.plane_prior import PLANE_DEPTH
from diff4splat.paths.camera_path import CameraPath, require_valid_path
from diff4splat.paths.preset_path import PresetPath
from diff4splat.paths.resize import resized
from diff4splat.paths.settings import PathFrame, PathSettings
from diff4splat.paths.spline import resample
from diff4splat.scene.extent import depth_quantiles

DEFAULT_FRAMES, DEFAULT_FPS = 49, 24.0


def path_frame(camera: Camera) -> PathFrame:
    """What presets are sized to before there is depth: the plane that carries the photograph."""
    return PathFrame(camera=camera, near_depth=PLANE_DEPTH, focus_depth=PLANE_DEPTH)


def as_preset(path: CameraPath | PresetPath | str) -> PresetPath | None:
    """A text with the default timing; None for cameras."""
    if isinstance(path, str):
        settings = PathSettings(frames=DEFAULT_FRAMES, fps=DEFAULT_FPS)
        return PresetPath(text=path, settings=settings)
    return path if isinstance(path, PresetPath) else None


def path_in_depth(preset: PresetPath, camera: Camera, depth: Float[Tensor, "h w"]) -> CameraPath:
    """Presets sized to the depth that ``camera`` sees."""
    depths = depth_quantiles(depth.detach().flatten())
    view = PathFrame(camera=camera, near_depth=depths.near, focus_depth=depths.focus)
    return preset.sized_to(view)


def to_camera_path(path: CameraPath | PresetPath | str, camera: Camera) -> CameraPath:
    """Presets in the image's view, or cameras at its size that start at the identity and 0 s."""
    if (preset := as_preset(path)) is not None:
        return preset.sized_to(path_frame(camera))
    fitting = resized(require_valid_path(path, "camera path"), camera.size_px)
    started = CameraPath(
        cameras=relative_to_first(fitting.cameras), times_s=fitting.times_s - fitting.times_s[0]
    )
    return started.to(camera.focal_px.dtype)


def reconcile_intrinsics(image: InputImage, path: CameraPath) -> tuple[InputImage, CameraPath]:
    """The first camera of the path took the photograph, so both must have one lens.

    A photograph whose lens is known keeps it, and the path keeps its zoom relative to its first
    camera; otherwise the photograph takes over the lens that the path names.
    """
    cameras, first = path.cameras, path.cameras[0]
    if torch.allclose(first.focal_px, image.camera.focal_px) and torch.allclose(
        first.center_px, image.camera.center_px
    ):
        return image, path
    if not image.focal_known:
        lens = replace(image.camera, focal_px=first.focal_px, center_px=first.center_px)
        return replace(image, camera=lens, focal_known=True, focal_source="camera path"), path
    matched = replace(
        cameras,
        focal_px=cameras.focal_px * (image.camera.focal_px / first.focal_px),
        center_px=cameras.center_px + (image.camera.center_px - first.center_px),
    )
    return image, replace(path, cameras=matched)


def resample_to_model_frames(path: CameraPath, frames: int) -> CameraPath:
    """``frames`` cameras spread evenly over ``path``, in the same span of time."""
    duration_s = float(path.times_s[-1] - path.times_s[0])
    fps = (frames - 1) / duration_s if duration_s > 0 and frames > 1 else DEFAULT_FPS
    return resample(path, frames, fps)
