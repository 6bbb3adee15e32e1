"""Work and settings of ``diff4splat generate``, counted from its options and the photo's header."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from diff4splat.cli.limits.costing import Costing, Promise
from diff4splat.cli.limits.stopwatch import Stopwatch
from diff4splat.outputs.budgets.choose import agrees
from diff4splat.outputs.budgets.limits import loss_from_error
from diff4splat.outputs.budgets.table import SettingValues

if TYPE_CHECKING:
    from torch import Tensor

    from diff4splat.cli.generate import Generate
    from diff4splat.outputs.card import Result

NAME = "generate"
DEFAULT_STEPS = 7
GAUSSIANS_PER_PX, PIXELS_ALONE, HIDDEN = 4.0, 1.0, 5000
"""With and without sub-pixel infill; those of the image's small copy in addition."""
REFERENCE_STEPS = 20


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """A run against what was expected of it."""

    asked: "Generate"
    """The command before its limits chose settings."""
    promised: Promise
    watch: Stopwatch

    def record(self, result: "Result") -> dict[str, object]:
        """For the card; with a tolerance the loss is measured."""
        measured = self.watch.read()
        if self.promised.limits.tolerance_db is not None:
            measured["loss_db"] = measured_loss_db(self.asked, result.first_view)
        return self.promised.record(measured)


def work(command: "Generate", frames: int, size_px: tuple[int, int]) -> dict[str, float | int]:
    """Counted work of a generation whose image has (height, width)."""
    pixels = size_px[0] * size_px[1]
    infill = command.infill != "none"
    gaussians = HIDDEN + pixels * (GAUSSIANS_PER_PX if infill else PIXELS_ALONE)
    steps = command.color_matching_steps
    return {
        "start": 1,
        "gaussians": gaussians,
        "matched_gaussians": gaussians * (DEFAULT_STEPS if steps is None else steps),
        "filmed_gaussians": gaussians * frames,
        "filmed_pixels": pixels * frames,
        "depth_pixels": 0 if command.skip_depth else pixels * frames,
        "prompted": float(command.prompt is not None and not command.still),
        "video_steps": float(command.fill == "video") * (command.steps or 8),
        "video_fill": float(command.fill == "video"),
    }


def request_work(command: "Generate") -> dict[str, float | int]:
    """The same from the options alone, and the header of the photo."""
    side_px, multiple_px = image_side(command)
    return work(command, frame_count(command), _size(command, side_px, multiple_px))


def frame_count(command: "Generate") -> int:
    """Frames of the camera path."""
    from diff4splat.cli.options.camera import FILE_SUFFIXES, PRESET_FRAMES

    if command.options.frames is not None:
        return command.options.frames
    if not command.camera.lower().endswith(FILE_SUFFIXES) and not Path(command.camera).is_file():
        return PRESET_FRAMES
    from diff4splat.cli.generation.inputs import read_image
    from diff4splat.cli.options.camera import choose_path
    from diff4splat.generation.inputs.input_cameras import path_frame

    return len(choose_path(command.camera, path_frame(read_image(command).camera), command.options))


def promise(command: "Generate") -> tuple["Generate", Promise]:
    """The command with the settings that its limits ask for, and what they are expected to need.

    Raises:
        ConfigError: no setting holds; says what is possible.
    """
    limits, costing = command.limits.limits, Costing.of(command.limits.calibration)
    plain = costing.promise(NAME, limits, request_work(command))
    if not limits.given:
        return command, plain
    frames, full_px = frame_count(command), image_side(command)[0]
    unit = photo_unit(command, full_px)
    choice = costing.choose(
        NAME,
        lambda values: _setting_work(command, values, full_px, frames),
        lambda values: agrees(values, fixed(command)) and _keeps_shape(command, values, full_px),
        limits,
        lambda row: row.error * unit(row.values),
    )
    return with_setting(command, choice.values, full_px), plain.with_choice(choice)


def measured_loss_db(command: "Generate", first_view: "Tensor") -> float:
    """What the first view loses against the photo at the size of the reference setting."""
    from diff4splat.cli.generation.inputs import read_image
    from diff4splat.cli.limits.measured import frame_error

    return round(loss_from_error(frame_error(first_view, read_image(command).rgb)), 4)


def fixed(command: "Generate") -> SettingValues:
    """Settings that the user has decided."""
    given: dict[str, float | int | bool | str] = {}
    if command.resolution is not None:
        given["side_share"] = 1.0
    if command.color_matching_steps is not None:
        given["color_matching_steps"] = command.color_matching_steps
    if command.infill is not None:
        given["infill"] = command.infill
    return given


def with_setting(command: "Generate", values: Mapping[str, object], full_px: int) -> "Generate":
    """``command`` with the settings of one row of the table; ``full_px`` is its own side."""
    resolution = command.resolution
    if values["side_share"] != 1.0:
        resolution = max(round(full_px * values["side_share"]), 1)
    return replace(
        command,
        resolution=resolution,
        color_matching_steps=values["color_matching_steps"],
        infill=values["infill"],
    )


def _keeps_shape(command: "Generate", values: SettingValues, full_px: int) -> bool:
    """Sides are whole tokens; a smaller image must not be cropped to another shape for that."""
    full, small = (
        _size(one, *image_side(one)) for one in (command, with_setting(command, values, full_px))
    )
    return full[0] * small[1] == full[1] * small[0]


def photo_unit(command: "Generate", full_px: int) -> "Callable[[SettingValues], float]":
    """What the error of a setting is a share of, for this photo."""
    from diff4splat.cli.generation.inputs import read_image

    rgb = read_image(command).rgb

    def unit(values: SettingValues) -> float:
        small = with_setting(command, values, full_px)
        return error_unit(rgb, _size(small, *image_side(small)))

    return unit


def error_unit(rgb: "Tensor", size_px: tuple[int, int]) -> float:
    """Mean square of what an image ``h w 3`` loses at (height, width), or at half of its own."""
    from diff4splat.generation.inputs.image_detail import image_detail, lost_at

    return image_detail(rgb) if size_px[0] >= rgb.shape[0] else lost_at(rgb, size_px)


def _setting_work(
    command: "Generate", values: SettingValues, full_px: int, frames: int
) -> dict[str, float | int]:
    chosen = with_setting(command, values, full_px)
    side_px, multiple_px = image_side(chosen)
    return work(chosen, frames, _size(command, side_px, multiple_px))


def image_side(command: "Generate") -> tuple[int, int]:
    """(side, multiple) of the image in pixels, from the options and the photo's header."""
    from diff4splat.generation.inputs.image_size import find_image_size
    from diff4splat.io.photos.images import photo_size

    photo_px = photo_size(command.image)
    given = command.depth is not None
    return find_image_size(command.model, command.resolution, command.fill, photo_px, given)


def _size(command: "Generate", side_px: int, multiple_px: int) -> tuple[int, int]:
    from diff4splat.generation.inputs.input_image import model_size
    from diff4splat.io.photos.images import photo_size

    return model_size(photo_size(command.image), side_px, multiple_px)
