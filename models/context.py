"""Camera paths as the model sees them: a fixed number of cameras spread over the asked path.

The path that generates a scene and the path it is shown along are different things: the first has
as many cameras as the model was made for, the second as many frames as the video.
"""

from diff4splat.geometry.camera import Camera
from diff4splat.models.base_scene import PLANE_DEPTH
from diff4splat.paths.build import build_path
from diff4splat.paths.camera_path import CameraPath, require_usable
from diff4splat.paths.picture_size import resized
from diff4splat.paths.settings import PathFrame, PathSettings
from diff4splat.paths.spline import resample

DEFAULT_FRAMES, DEFAULT_FPS = 49, 24.0


def view_of(camera: Camera) -> PathFrame:
    """What presets are sized to before there is a scene: the plane that carries the photograph."""
    return PathFrame(camera=camera, near_depth=PLANE_DEPTH, focus_depth=PLANE_DEPTH)


def as_path(path: CameraPath | str, camera: Camera) -> CameraPath:
    """Presets resolved in the picture's view, or cameras brought to the picture's size."""
    if isinstance(path, str):
        settings = PathSettings(frames=DEFAULT_FRAMES, fps=DEFAULT_FPS)
        return build_path(path, view_of(camera), settings)
    return resized(require_usable(path, "camera path"), camera.size_px)


def context_path(path: CameraPath, frames: int) -> CameraPath:
    """``frames`` cameras spread evenly over ``path``, in the same span of time."""
    duration_s = float(path.times_s[-1] - path.times_s[0])
    fps = (frames - 1) / duration_s if duration_s > 0 and frames > 1 else DEFAULT_FPS
    return resample(path, frames, fps)
