"""A video with known cameras as the networks see it: some of its frames, at one small size.

Axes: ``f`` frames, ``g`` other frames, ``n`` all frames of the camera, ``m`` some of them,
``h w`` pixels.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Float, Int
from torch import Tensor

from diff4splat.data.capture.capture import Capture
from diff4splat.errors import InputError
from diff4splat.generation.inputs.input_image import (
    SIDE_MULTIPLE,
    FocalChoice,
    InputImage,
    prepare_image,
)
from diff4splat.geometry.camera import Camera
from diff4splat.models.config.networks import TIME_STRIDE
from diff4splat.paths.camera_path import CameraPath, require_valid_path

LEAST_FRAMES, DEFAULT_FRAMES = 1 + TIME_STRIDE, 1 + 2 * TIME_STRIDE


@dataclass(frozen=True, slots=True, kw_only=True)
class VideoChoice:
    """Which frames of a capture, and how large."""

    camera: int | None = None
    """Number of the camera; None is the first that fitting learns from."""
    frames: int = DEFAULT_FRAMES
    """At most, spread evenly; the largest possible 1 + 4 k is taken."""
    side_px: int = 64
    """Side of a square with as many pixels as the images have at most."""
    multiple_px: int = SIDE_MULTIPLE


@dataclass(frozen=True, slots=True, kw_only=True)
class InputVideo:
    """Frames in order of time."""

    rgb: Float[Tensor, "f h w 3"]
    path: CameraPath
    """In the capture's world frame and unit, at its times; intrinsics of the images."""
    index: Int[Tensor, " f"]
    """Numbers of the frames in the capture."""
    other_index: Int[Tensor, " g"]
    """Of the camera's other frames."""
    full_path: CameraPath
    """Of all its frames."""
    notes: tuple[str, ...] = ()
    """What was done to the images, in words."""


def choose_video(capture: Capture, choice: VideoChoice) -> InputVideo:
    """Frames of one camera, cropped around the centre and reduced alike.

    Raises:
        InputError: too few frames, no such camera, a lens that is no pinhole, or cameras that no
            renderer can follow.
        ConfigError: the size is out of range.
    """
    _require_pinholes(capture)
    every = frames_of_camera(capture, choice.camera)
    chosen = _spread(every, choice.frames)
    images = [read_image(capture, int(number), choice) for number in chosen]
    whole = CameraPath(
        cameras=_cut(capture.cameras[every], images[0]), times_s=capture.times_s[every]
    )
    whole = require_valid_path(whole, "cameras of the video")
    place = torch.searchsorted(whole.times_s, capture.times_s[chosen])
    return InputVideo(
        rgb=torch.stack([image.rgb for image in images]),
        path=CameraPath(cameras=whole.cameras[place], times_s=whole.times_s[place]),
        index=chosen,
        other_index=every[~torch.isin(every, chosen)],
        full_path=whole,
        notes=images[0].notes,
    )


def read_image(capture: Capture, number: int, choice: VideoChoice) -> InputImage:
    """A frame at the networks' size; of its camera only the window counts.

    Raises:
        FileFormatError: as ``Frames.read``.
    """
    rgb = capture.frames.read(number).rgb
    focal = FocalChoice(focal_px=float(rgb.shape[1]), source="")
    return prepare_image(rgb, focal, choice.side_px, choice.multiple_px)


def frames_of_camera(capture: Capture, camera: int | None = None) -> Int[Tensor, " n"]:
    """Frames of a camera that fitting learns from, one per time, in order of time.

    Raises:
        InputError: there is no such camera.
    """
    learnt = capture.learnt
    numbers = capture.camera_index[learnt]
    if not len(numbers):
        raise InputError(f"{capture.name}: expected frames that are not held out, got none")
    camera = int(numbers[0]) if camera is None else camera
    index = learnt[numbers == camera]
    if not len(index):
        known = ", ".join(map(str, sorted(set(numbers.tolist()))))
        raise InputError(f"--camera: expected one of {known}, got {camera}")
    index = index[capture.times_s[index].argsort(stable=True)]
    later = capture.times_s[index].diff(prepend=capture.times_s.new_tensor([-torch.inf])) > 0
    return index[later]


def evenly(index: Int[Tensor, " n"], most: int) -> Int[Tensor, " m"]:
    """At most so many of them, the first and the last among them."""
    count = min(len(index), most)
    return index[torch.linspace(0, max(len(index) - 1, 0), count).round().long()]


def _spread(index: Int[Tensor, " n"], frames: int) -> Int[Tensor, " f"]:
    """The largest 1 + 4 k of at most ``frames`` frames, evenly."""
    if len(index) < LEAST_FRAMES:
        raise InputError(
            f"video: expected at least {LEAST_FRAMES} frames of one camera at different times, "
            f"got {len(index)}; name another with --camera, or use `diff4splat fit`"
        )
    most = min(len(index), frames)
    count = 1 + TIME_STRIDE * ((most - 1) // TIME_STRIDE)
    return evenly(index, count)


def _require_pinholes(capture: Capture) -> None:
    if capture.optics is not None:
        raise InputError(
            f"{capture.name}: expected pinhole cameras, got a lens or shutter with effects; "
            "undistort the images, or use `diff4splat fit`"
        )


def _cut(cameras: Camera, image: InputImage) -> Camera:
    """The cameras of the window that ``image`` shows, at its size."""
    window = image.window
    part = cameras.cropped(window.corner_px, window.size_px)
    return part.resized((image.rgb.shape[0], image.rgb.shape[1]))
