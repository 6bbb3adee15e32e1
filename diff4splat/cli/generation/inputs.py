"""What ``generate`` reads: photo, camera path and given depth."""

from typing import TYPE_CHECKING

from diff4splat.cli.generation.notes import announce
from diff4splat.cli.options.camera import choose_path, read_preset
from diff4splat.cli.options.depth import depth_file
from diff4splat.generation.given_depth.source import DepthSource, open_depth
from diff4splat.generation.inputs.image_size import find_image_size
from diff4splat.generation.inputs.input_cameras import path_frame, reconcile_intrinsics
from diff4splat.generation.inputs.input_image import InputImage, load_image
from diff4splat.io.photos.images import photo_size
from diff4splat.paths.camera_path import CameraPath
from diff4splat.paths.preset_path import PresetPath

if TYPE_CHECKING:
    from diff4splat.cli.generate import Generate


def read_inputs(command: "Generate") -> tuple[InputImage, CameraPath | PresetPath]:
    """The photo at the model's size and the camera path, announced.

    Presets are sized once the depth of the photo is known.
    """
    input_image, preset = read_image(command), read_preset(command.camera, command.options)
    asked = choose_path(command.camera, path_frame(input_image.camera), command.options)
    input_image, path = reconcile_intrinsics(input_image, asked)
    announce(command, input_image, path)
    return input_image, path if preset is None else preset


def read_image(command: "Generate") -> InputImage:
    """The photograph at the model's size."""
    photo_px = photo_size(command.image)
    side_px, multiple_px = find_image_size(
        command.model, command.resolution, command.fill, photo_px, command.depth is not None
    )
    return load_image(
        command.image, side_px, command.fov, command.convert, multiple_px, command.fit
    )


def given_depth(command: "Generate") -> DepthSource | None:
    """The network or map of --depth, opened."""
    if command.depth is None:
        return None
    return open_depth(depth_file(command.depth), command.depth_kind)
