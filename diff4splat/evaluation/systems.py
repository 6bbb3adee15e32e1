"""Systems under test: what sees the input of a case and answers with a scene."""

from collections.abc import Callable, Collection
from dataclasses import dataclass, field
from typing import Protocol as Interface
from typing import runtime_checkable

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.data.clip import Clip
from diff4splat.evaluation.sample import Case
from diff4splat.generation.input_image import InputImage
from diff4splat.generation.pipeline import Diff4SplatPipeline
from diff4splat.generation.plan import RequestFacts, plan_generation
from diff4splat.generation.settings import GenerationSettings
from diff4splat.generation.video_to_scene import scene_from_video
from diff4splat.geometry.camera import Camera
from diff4splat.io.pixels import unit_rgb
from diff4splat.models.hub.model import Model
from diff4splat.paths.camera_path import CameraPath
from diff4splat.scene.scene import Scene


@dataclass(frozen=True, slots=True, kw_only=True)
class Identity:
    """Which system a result belongs to; results are reused only when all of it is equal."""

    name: str
    """For people, such as ``small``."""
    weights_sha256: str
    fingerprint: str
    """Of the configuration."""
    settings: str
    """Everything else that changes answers, in words or JSON."""
    untrained: bool


@runtime_checkable
class Subject(Interface):
    """A system under test."""

    @property
    def identity(self) -> Identity:
        """Which system this is."""
        ...

    def answer(self, case: Case, seed: int) -> Scene:
        """A scene in the case's units and world (its first camera); time starts at 0."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Generator:
    """The pipeline: first picture, camera path of the input view, caption."""

    pipeline: Diff4SplatPipeline
    settings: GenerationSettings = field(default_factory=GenerationSettings)

    @property
    def identity(self) -> Identity:
        """Model and sampling settings."""
        model = self.pipeline.model
        facts = RequestFacts(prompt=True, fill=self.settings.fill, still=self.settings.still)
        plan = plan_generation(model.config, model.trained, facts)
        return model_identity(model, plan.parts, repr(self.settings))

    def answer(self, case: Case, seed: int) -> Scene:
        """Generate along the input view's cameras, with the clip's caption if it has one."""
        return self.generate(case, case.clip.note.caption or None, seed)

    def generate(self, case: Case, prompt: str | None, seed: int) -> Scene:
        """Generate with another caption."""
        cameras = case.input_view.cameras.to(torch.float32)
        path = CameraPath(cameras=cameras, times_s=case.clip.times_s.float())
        picture = input_picture(case.input_rgb(0), cameras[0])
        return self.pipeline(picture, path, prompt, seed=seed, settings=self.settings)


@dataclass(frozen=True, slots=True, kw_only=True)
class Reconstructor:
    """Any function from the given part of a clip (``Case.input_clip``) to a scene."""

    reconstruct: Callable[[Clip], Scene]
    identity: Identity

    def answer(self, case: Case, seed: int) -> Scene:
        """Reconstruct; the truth is not handed on, and nothing is drawn, so no seed is needed."""
        del seed
        return self.reconstruct(case.input_clip)


def reconstruct_clip(model: Model, clip: Clip) -> Scene:
    """The scene that a model's reconstruction sees in a clip's input view."""
    view = clip.views[0]
    path = CameraPath(cameras=view.cameras.to(torch.float32), times_s=clip.times_s.float())
    return scene_from_video(model, unit_rgb(view.rgb), path)


def model_identity(model: Model, parts: Collection[str], settings: str) -> Identity:
    """Which model runs, with which of its networks."""
    return Identity(
        name=model.config.name,
        weights_sha256=model.weights_sha256(parts),
        fingerprint=model.config.fingerprint(),
        settings=settings,
        untrained=not model.trained.issuperset(parts),
    )


def input_picture(rgb: Float[Tensor, "h w 3"], camera: Camera) -> InputImage:
    """The first picture with the lens that the clip names."""
    return InputImage(rgb=rgb, camera=camera, focal_source="clip")
