"""Cameras for another image size."""

from dataclasses import replace

from diff4splat.geometry.camera import Camera
from diff4splat.paths.camera_path import CameraPath


def fitted(camera: Camera, size_px: tuple[int, int]) -> Camera:
    """Camera of the image scaled to cover ``size_px``, then cropped at the centre.

    Pixels keep their aspect ratio; with the same aspect ratio this is ``Camera.resized``.
    """
    (height, width), (new_height, new_width) = camera.size_px, size_px
    factor = max(new_height / height, new_width / width)
    center = camera.center_px.new_tensor([width / 2, height / 2])
    new_center = camera.center_px.new_tensor([new_width / 2, new_height / 2])
    return replace(
        camera,
        focal_px=camera.focal_px * factor,
        center_px=(camera.center_px - center) * factor + new_center,
        size_px=size_px,
    )


def resized(path: CameraPath, size_px: tuple[int, int]) -> CameraPath:
    """The path for images that are scaled and cropped to ``size_px``, as in ``fitted``."""
    return replace(path, cameras=fitted(path.cameras, size_px))
