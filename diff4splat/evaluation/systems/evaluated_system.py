"""Evaluated systems: they get the input of a sample and predict a scene."""

from collections.abc import Callable, Collection
from dataclasses import dataclass, field
from typing import Protocol as Interface
from typing import runtime_checkable

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.data.clip import Clip
from diff4splat.evaluation.protocols.sample import EvalSample
from diff4splat.generation.inputs.input_image import InputImage
from diff4splat.generation.pipeline import Diff4SplatPipeline
from diff4splat.generation.plan import RequestFacts, plan_generation
from diff4splat.generation.settings import GenerationSettings
from diff4splat.generation.video.video_to_scene import scene_from_video
from diff4splat.geometry.camera import Camera
from diff4splat.io.pixels import unit_rgb
from diff4splat.models.hub.model import Model
from diff4splat.paths.camera_path import CameraPath
from diff4splat.scene.scene import Scene


@dataclass(frozen=True, slots=True, kw_only=True)
class Identity:
    """Identity of a system; stored results are reused only if all fields are equal."""

    name: str
    """Readable name, such as ``small``."""
    weights_sha256: str
    fingerprint: str
    """Hash of the configuration."""
    settings: str
    """Everything else that changes predictions, as text."""
    untrained: bool


@runtime_checkable
class EvaluatedSystem(Interface):
    """A system that predicts a scene."""

    @property
    def identity(self) -> Identity:
        """Identity of the system."""
        ...

    def predict(self, sample: EvalSample, seed: int) -> Scene:
        """Predict a scene in the units and world frame of the sample; time starts at 0."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Generator:
    """The generation pipeline: first image, camera path of the input view, caption."""

    pipeline: Diff4SplatPipeline
    settings: GenerationSettings = field(default_factory=GenerationSettings)

    @property
    def identity(self) -> Identity:
        """Model and sampling settings."""
        return model_identity(self.pipeline.model, self.parts, repr(self.settings))

    @property
    def parts(self) -> frozenset[str]:
        """Networks that run for a photograph with a prompt."""
        model, settings = self.pipeline.model, self.settings
        facts = RequestFacts(
            prompt=True,
            fill=settings.fill,
            still=settings.still,
            names_class=True,
            photograph=True,
            without=settings.without,
        )
        return plan_generation(model.config, model.trained, facts).parts

    def predict(self, sample: EvalSample, seed: int) -> Scene:
        """Generate along the cameras of the input view, with the clip's caption if any."""
        return self.generate(sample, sample.clip.note.caption or None, seed)

    def generate(self, sample: EvalSample, prompt: str | None, seed: int) -> Scene:
        """Generate with another caption."""
        cameras = sample.input_view.cameras.to(torch.float32)
        path = CameraPath(cameras=cameras, times_s=sample.clip.times_s.float())
        image = input_image(sample.input_rgb(0), cameras[0])
        return self.pipeline(image, path, prompt, seed=seed, settings=self.settings)


@dataclass(frozen=True, slots=True, kw_only=True)
class Reconstructor:
    """Any function from the input of a sample (``EvalSample.input_clip``) to a scene."""

    reconstruct: Callable[[Clip], Scene]
    identity: Identity

    def predict(self, sample: EvalSample, seed: int) -> Scene:
        """Reconstruct from the input alone; deterministic, so ``seed`` is unused."""
        del seed
        return self.reconstruct(sample.input_clip)


def reconstruct_clip(model: Model, clip: Clip, settings: GenerationSettings | None = None) -> Scene:
    """Reconstruct a scene from the input view of a clip."""
    view = clip.views[0]
    path = CameraPath(cameras=view.cameras.to(torch.float32), times_s=clip.times_s.float())
    return scene_from_video(model, unit_rgb(view.rgb), path, settings)


def model_identity(model: Model, parts: Collection[str], settings: str) -> Identity:
    """Identity of a model of which ``parts`` run."""
    return Identity(
        name=model.config.name,
        weights_sha256=model.weights_sha256(parts),
        fingerprint=model.config.fingerprint(),
        settings=settings,
        untrained=not model.trained.issuperset(parts),
    )


def input_image(rgb: Float[Tensor, "h w 3"], camera: Camera) -> InputImage:
    """The first image with the camera of the clip."""
    return InputImage(rgb=rgb, camera=camera, focal_source="clip")
