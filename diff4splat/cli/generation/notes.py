"""What ``generate`` says before the work."""

from typing import TYPE_CHECKING

from diff4splat.cli.common.console import note
from diff4splat.cli.options.models import prompt_notes

if TYPE_CHECKING:
    from diff4splat.cli.generate import Generate
    from diff4splat.generation.inputs.input_image import InputImage
    from diff4splat.paths.camera_path import CameraPath


def announce(command: "Generate", input_image: "InputImage", path: "CameraPath") -> None:
    """Say what is known before the work; refuse what cannot fit.

    Raises:
        ConfigError: more memory or disk is needed than is free.
    """
    from diff4splat.models.ldrm.plane_prior import PLANE_DEPTH
    from diff4splat.outputs.run_estimate import estimate_generation, require_fits
    from diff4splat.paths.summary import summarize

    note("; ".join((f"focal length: {input_image.focal_source}", *input_image.notes)))
    for line in prompt_notes(command.prompt, command.model):
        note(line)
    for warning in summarize(path, PLANE_DEPTH).warnings:
        note(f"camera path: {warning}")
    size_px, depth = input_image.camera.size_px, not command.skip_depth
    needed = estimate_generation(len(path), size_px, depth, command.video == "gif")
    require_fits(needed, command.out, "fewer --frames, --skip-depth or a smaller size")
