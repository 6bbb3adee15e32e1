"""Options of ``generate`` as settings of the pipeline, and as the card lists them."""

from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING

from diff4splat.flow.guidance import DEFAULT_GUIDANCE
from diff4splat.generation.inputs.input_image import InputImage
from diff4splat.generation.settings import GenerationSettings, MotionSettings, require_seed
from diff4splat.io.file_digest import file_sha256
from diff4splat.models.hub.folders import find_config
from diff4splat.models.text_encoder.prompt import require_prompt

if TYPE_CHECKING:
    from diff4splat.cli.generate import Generate

SEPARATE = ("options", "limits")
"""Groups of options, whose members the card lists."""


def generation_settings(command: "Generate") -> GenerationSettings:
    """Seed, prompt, sampling, guidance and pruning, checked before anything is loaded."""
    require_seed(command.seed)
    if command.prompt is not None:
        require_prompt(command.prompt, find_config(command.model).text.max_bytes)
    given = _given(steps=command.steps, shift=command.shift)
    if command.guidance is not None:
        given["guidance"] = replace(DEFAULT_GUIDANCE, weight=command.guidance)
    return GenerationSettings(
        sampler=command.sampler,
        latent_tolerance=command.latent_tolerance,
        fill=command.fill,
        negative_prompt=command.negative_prompt,
        still=command.still,
        min_opacity=command.min_opacity,
        motion=MotionSettings(**given),
        subpixel_infill=command.infill != "none",
        **_given(color_matching_steps=command.color_matching_steps),
        **given,
    )


def _given(**options: object) -> dict[str, object]:
    """Without those whose default is that of the settings."""
    return {name: value for name, value in options.items() if value is not None}


def settings_record(
    command: "Generate", input_image: InputImage, settings: GenerationSettings
) -> dict[str, object]:
    """Every setting as it was used, for the card."""
    given = {name: value for name, value in asdict(command).items() if name not in SEPARATE}
    given = {"image": command.image} | {name: given[name] for name in given if name != "images"}
    given |= asdict(command.options) | asdict(command.limits)
    given |= {"generation": asdict(settings)}
    given |= {"focal_source": input_image.focal_source, "notes": input_image.notes}
    given |= {"image_sha256": file_sha256(command.image)}
    return {name: str(value) if isinstance(value, Path) else value for name, value in given.items()}
