"""How large an image is used, and how much of it the networks see.

Where the image's own pixels are shown, the scene is as fine as the image, and networks see a
smaller copy of about the size that they were trained for. Where LDRM reconstructs every frame, the
scene is as fine as the networks' grid.
"""

import math
from collections.abc import Collection

from diff4splat.generation.inputs.input_image import require_side
from diff4splat.generation.plan import (
    GenerationPlan,
    RequestFacts,
    plan_generation,
)
from diff4splat.models.config.model import Fill, ModelConfig
from diff4splat.models.hub.folders import find_config, find_provenance

DEFAULT_SIDE_PX, LEAST_DEFAULT_PX = 512, 256
"""Side of a square with as many pixels as an image has by default; smaller images are enlarged to
the second at most."""


def default_side_px(
    config: ModelConfig, plan: GenerationPlan, photo_px: tuple[int, int] | None = None
) -> int:
    """Side of a square with as many pixels as an image of ``photo_px``, read from a file."""
    trained_px = trained_side_px(config)
    if not plan.shows_image:
        return trained_px
    side_px = DEFAULT_SIDE_PX if photo_px is None else round(math.sqrt(math.prod(photo_px)))
    return max(trained_px, LEAST_DEFAULT_PX, min(side_px, DEFAULT_SIDE_PX))


def trained_side_px(config: ModelConfig) -> int:
    """Side of a square with as many pixels as the model was made for."""
    return round(math.sqrt(math.prod(config.size_px)))


def size_multiple_px(config: ModelConfig, plan: GenerationPlan, side_px: int) -> int:
    """What sides of images of about ``side_px`` must be multiples of."""
    if not plan.shows_image:
        return config.token_px
    return config.token_px * max(round(side_px / trained_side_px(config)), 1)


def downsampling_factor(config: ModelConfig, plan: GenerationPlan, size_px: tuple[int, int]) -> int:
    """Pixels of the image per pixel side that the networks see.

    Of the factors that leave whole tokens it is the one whose result has most nearly as many
    pixels as the networks were trained for.
    """
    side_px, trained_px = math.sqrt(math.prod(size_px)), trained_side_px(config)
    wanted = max(round(side_px / trained_px), 1)
    if wanted == 1 or not plan.shows_image:
        return 1
    fitting = [
        factor
        for factor in range(1, 2 * wanted)
        if not any(side % (factor * config.token_px) for side in size_px)
    ]
    return min(fitting, key=lambda factor: abs(math.log(side_px / trained_px / factor)), default=1)


def is_photograph(
    config: ModelConfig, trained: Collection[str], fill: Fill | None, size_px: tuple[int, int]
) -> bool:
    """Whether an image is larger than any copy that networks see of it."""
    factor = downsampling_factor(config, image_plan(config, trained, fill), size_px)
    scale = config.monocular_depth.photo_scale
    return factor > (1 if factor % scale else scale)


def find_image_size(
    name_or_folder: str,
    side_px: int | None = None,
    fill: Fill | None = None,
    photo_px: tuple[int, int] | None = None,
    depth_given: bool = False,
) -> tuple[int, int]:
    """(side, multiple) in pixels for a model, before any weights are read.

    Raises:
        ConfigError, CheckpointError, FileFormatError: as ``load_model``.
    """
    config = find_config(name_or_folder)
    plan = image_plan(config, find_provenance(name_or_folder).trained, fill, depth_given)
    side_px = default_side_px(config, plan, photo_px) if side_px is None else side_px
    require_side(side_px, config.token_px)
    return side_px, size_multiple_px(config, plan, side_px)


def image_plan(
    config: ModelConfig,
    trained: Collection[str],
    fill: Fill | None = None,
    depth_given: bool = False,
) -> GenerationPlan:
    """The plan as far as it decides about sizes: prompts do not."""
    facts = RequestFacts(prompt=False, fill=fill, depth_given=depth_given)
    return plan_generation(config, trained, facts)
