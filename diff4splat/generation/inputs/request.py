"""One generation, validated: everything that can be refused is refused before weights are read."""

from dataclasses import dataclass, replace
from pathlib import Path

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.captions.events import moving_events, why_static
from diff4splat.captions.image_classes.prompt_classes import prompt_classes
from diff4splat.flow.guidance import DEFAULT_GUIDANCE
from diff4splat.generation.given_depth.source import DepthSource
from diff4splat.generation.inputs.image_size import (
    default_side_px,
    downsampling_factor,
    image_plan,
    is_photograph,
    size_multiple_px,
)
from diff4splat.generation.inputs.input_cameras import (
    as_preset,
    path_in_depth,
    reconcile_intrinsics,
    resample_to_model_frames,
    to_camera_path,
)
from diff4splat.generation.inputs.input_image import InputImage, downsample, load_image
from diff4splat.generation.plan import (
    GenerationPlan,
    RequestFacts,
    plan_generation,
)
from diff4splat.generation.settings import GenerationSettings, require_seed
from diff4splat.io.photos.images import photo_size
from diff4splat.models.config.model import ModelConfig
from diff4splat.models.hub.model import Model
from diff4splat.models.text_encoder.prompt import require_prompt
from diff4splat.paths.camera_path import CameraPath
from diff4splat.paths.preset_path import PresetPath


@dataclass(frozen=True, slots=True, kw_only=True)
class UserInput:
    """What a generation is asked for."""

    image: InputImage | Path | str
    path: CameraPath | PresetPath | str
    prompt: str | None
    seed: int
    settings: GenerationSettings
    depth: DepthSource | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Request:
    """The same, at sizes that the networks can take, with the plan."""

    image: InputImage
    small: InputImage
    """The copy that the networks see."""
    path: CameraPath
    """Along which the scene is shown."""
    small_path: CameraPath
    """As many cameras as the model was made for, at the size of the copy."""
    prompt: str | None
    seed: int
    settings: GenerationSettings
    plan: GenerationPlan
    depth: DepthSource | None = None
    preset: PresetPath | None = None
    """What ``path`` was built from, to be sized to the depth of the image."""

    @property
    def key_times_s(self) -> Float[Tensor, " k"]:
        """Times at which the scene keeps the image's motion, evenly spread."""
        times_s, count = self.small_path.times_s, self.settings.key_times
        if count is None:
            return times_s
        return torch.linspace(float(times_s[0]), float(times_s[-1]), count).to(times_s)


def prepare_request(model: Model, user: UserInput, device: torch.device) -> Request:
    """Check and resize the input, and plan which networks run.

    Raises:
        InputError: the image, the path or the prompt cannot be used.
        ConfigError: a setting that this model cannot satisfy.
    """
    config, settings = model.config, user.settings
    if user.prompt is not None:
        require_prompt(user.prompt, config.text.max_bytes)
    if settings.negative_prompt:
        require_prompt(settings.negative_prompt, config.text.max_bytes)
    image = _load(model, user)
    image, path = reconcile_intrinsics(image, to_camera_path(user.path, image.camera))
    facts = RequestFacts(
        prompt=user.prompt is not None,
        fill=settings.fill,
        still=settings.still,
        frames=config.frames,
        depth_given=user.depth is not None,
        static_prompt="" if user.prompt is None else why_static(user.prompt),
        names_class=any(map(prompt_classes, moving_events(user.prompt or ""))),
        photograph=is_photograph(config, model.trained, settings.fill, image.camera.size_px),
        extended=settings.extended_layers,
        without=settings.without,
    )
    plan = plan_generation(config, model.trained, facts)
    image = image.to(device)
    small = downsample(image, downsampling_factor(config, plan, image.camera.size_px))
    return Request(
        image=image,
        small=small,
        path=path,
        small_path=_network_path(path, config.frames, small).to(device),
        prompt=user.prompt,
        seed=require_seed(user.seed),
        settings=_with_guidance(settings, config),
        plan=plan,
        depth=user.depth,
        preset=as_preset(user.path),
    )


def sized_to_depth(request: Request, depth: Float[Tensor, "h w"]) -> Request:
    """The request with presets sized to the depth of the image; given cameras stay as they are."""
    if request.preset is None:
        return request
    path = path_in_depth(request.preset, request.path.cameras[0], depth)
    small_path = _network_path(path, len(request.small_path), request.small).to(depth.device)
    return replace(request, path=path, small_path=small_path)


def _with_guidance(settings: GenerationSettings, config: ModelConfig) -> GenerationSettings:
    """The model's own where none is asked for."""
    if settings.guidance is not None:
        return settings
    return replace(settings, guidance=replace(DEFAULT_GUIDANCE, weight=config.default_guidance))


def negative_prompt(request: Request, config: ModelConfig) -> str | None:
    """The text of the pass without the prompt; None where that pass has no text.

    Models that pad prompts need text in any case: without a prompt that is the empty one.
    """
    if not request.plan.fills:
        return None
    if config.dit.padded_text_tokens:
        return "" if request.prompt is None else request.settings.negative_prompt
    return request.settings.negative_prompt or None


def _load(model: Model, user: UserInput) -> InputImage:
    """The image at a size that the model can take, in single precision."""
    config, image = model.config, user.image
    if not isinstance(image, InputImage):
        given = user.depth is not None
        plan = image_plan(config, model.trained, user.settings.fill, given)
        side_px = default_side_px(config, plan, photo_size(Path(image)))
        multiple_px = size_multiple_px(config, plan, side_px)
        image = load_image(Path(image), side_px, multiple_px=multiple_px)
    config.latent_grid(config.frames, image.camera.size_px)
    return replace(image, rgb=image.rgb.float(), camera=image.camera.to(torch.float32))


def _network_path(path: CameraPath, frames: int, small: InputImage) -> CameraPath:
    sampled = resample_to_model_frames(path, frames)
    return replace(sampled, cameras=sampled.cameras.resized(small.camera.size_px))
