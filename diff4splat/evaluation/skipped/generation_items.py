"""Items of a generation: networks that are not run, the guidance pass, and the path as a whole."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import torch

from diff4splat.evaluation.skipped.measurement import Frames, Item
from diff4splat.evaluation.skipped.scene_items import (
    film,
    film_singly,
    padded,
    tensor_bytes,
    zero_motion,
)
from diff4splat.flow.guidance import Guidance
from diff4splat.generation.inputs.copies import Copies, motion_copy
from diff4splat.generation.inputs.image_size import (
    downsampling_factor,
    find_image_size,
    image_plan,
)
from diff4splat.generation.inputs.input_cameras import path_frame
from diff4splat.generation.inputs.input_image import InputImage, downsample, load_image
from diff4splat.generation.motion.motion_mask import motion_probability
from diff4splat.generation.motion.networks import motion_prior
from diff4splat.generation.motion.sampling import MotionRequest, sample_motion
from diff4splat.generation.pipeline import Diff4SplatPipeline
from diff4splat.generation.plan import FILL_PARTS, MOTION_PARTS
from diff4splat.generation.settings import GenerationSettings, MotionSettings
from diff4splat.models.hub.model import load_model
from diff4splat.paths.build import build_path
from diff4splat.paths.camera_path import CameraPath
from diff4splat.paths.settings import PathSettings
from diff4splat.scene.motion.static import StaticMotion
from diff4splat.scene.scene import Scene

PROMPT = "a rounded block slides to the left"
NO_TEXT = "nothing moves"
FORCED = Guidance(weight=1 + 1e-9)
"""A weight of 1 that runs both passes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Source:
    """One photograph and the path that its scene is filmed along."""

    name: str
    image: InputImage
    path: CameraPath
    prompt: str | None
    model: str = "small"

    @classmethod
    def of(cls, photo: Path, side_px: int, prompt: str | None = None, frames: int = 9) -> "Source":
        """A photograph's file at a size, along an arc."""
        side_px, multiple_px = find_image_size("small", side_px)
        image = load_image(photo, side_px, multiple_px=multiple_px, convert=True)
        path = build_path("arc:0.1", path_frame(image.camera), PathSettings(frames=frames, fps=8.0))
        return cls(name=photo.stem, image=image, path=path, prompt=prompt)

    def scene(self, prompt: str | None = None, **settings: object) -> Scene:
        """Generate with a fresh model, so that weights are read."""
        pipeline = Diff4SplatPipeline.from_pretrained(self.model)
        return pipeline(self.image, self.path, prompt, settings=GenerationSettings(**settings))

    def weights_bytes(self, *parts: str) -> float:
        """Of networks of the model, as they are loaded."""
        networks = load_model(self.model, parts=parts).networks
        return sum(tensor_bytes(network) for _, network in networks.parts())


def generation_items(source: Source) -> Iterator[Item]:
    """Everything that can be left out while this photograph becomes a scene."""

    def lean() -> Frames:
        return film(source.scene(source.prompt))

    if source.prompt is None:
        yield from unprompted_items(source, lean)
    else:
        yield guidance_item(source)
    yield fill_item(source, lean)


def unprompted_items(source: Source, lean: Callable[[], Frames]) -> Iterator[Item]:
    """Without a prompt: no text, no motion prior; and all of it together."""
    yield Item(
        name="text encoder",
        full=lambda: _with_text(source),
        lean=lean,
        saved_bytes=source.weights_bytes("text_encoder"),
    )
    yield Item(
        name="motion prior",
        full=lambda: _with_motion(source),
        lean=lean,
        saved_bytes=source.weights_bytes(*MOTION_PARTS),
    )
    yield all_items(source, lean)


def guidance_item(source: Source) -> Item:
    """With a weight of 1 the second pass of the motion prior changes nothing."""
    motion = MotionSettings(steps=4)
    return Item(
        name="guidance pass",
        full=lambda: film(source.scene(source.prompt, motion=replace(motion, guidance=FORCED))),
        lean=lambda: film(source.scene(source.prompt, motion=motion)),
        saved_bytes=0.0,
    )


def fill_item(source: Source, lean: Callable[[], Frames]) -> Item:
    """The video model, LDRM and the deformation network; they change hidden regions."""
    return Item(
        name="video model, LDRM, deformation network",
        full=lambda: film(source.scene(source.prompt, fill="video")),
        lean=lean,
        saved_bytes=source.weights_bytes(*FILL_PARTS),
    )


def all_items(source: Source, lean: Callable[[], Frames]) -> Item:
    """Everything done that a static scene without a prompt does not need, against nothing of it."""
    return Item(
        name="all together, static and without a prompt",
        full=lambda: full_path(source),
        lean=lean,
        saved_bytes=source.weights_bytes(*MOTION_PARTS, *FILL_PARTS),
        compared=lambda: film_singly(keyed(source.scene()), ("rgb", "depth")),
    )


def full_path(source: Source) -> Frames:
    """All networks run; every Gaussian has key times and harmonics; each frame is made anew."""
    run_motion_prior(source)
    scene = source.scene(fill="video", motion=MotionSettings(guidance=FORCED))
    return film_singly(keyed(replace(scene, motion=StaticMotion())), ("rgb", "depth"))


def keyed(scene: Scene) -> Scene:
    """A static scene with key times and harmonics that change nothing."""
    gaussians = replace(scene.gaussians, sh=padded(scene.gaussians.sh))
    return replace(scene, gaussians=gaussians, motion=zero_motion(scene))


@torch.no_grad()
def run_motion_prior(source: Source) -> None:
    """Text encoder and motion prior, both passes; what they say is then not used."""
    model = load_model(source.model, parts=MOTION_PARTS)
    plan = image_plan(model.config, model.trained)
    factor = downsampling_factor(model.config, plan, source.image.camera.size_px)
    small = downsample(source.image, factor)
    frames = model.config.latent_grid(model.config.frames, small.camera.size_px)[0]
    text = model.networks.text_encoder.encode_prompt(PROMPT)
    settings = GenerationSettings(motion=MotionSettings(guidance=FORCED))
    request = MotionRequest(text=text, seed=0, settings=settings)
    copies = Copies(image=source.image, small=small)
    image = motion_copy(copies, model.config.motion_unet.input_scale)
    motion_probability(motion_prior(model.networks), image, frames, request)
    sample_motion(motion_prior(model.networks), image, frames, request)


def _with_text(source: Source) -> Frames:
    model = load_model(source.model, parts=("text_encoder",))
    with torch.no_grad():
        model.networks.text_encoder.encode_prompt(NO_TEXT)
    return film(source.scene())


def _with_motion(source: Source) -> Frames:
    run_motion_prior(source)
    return film(source.scene())
