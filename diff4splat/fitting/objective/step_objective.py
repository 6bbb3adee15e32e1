"""The loss of one step: frames of one time, rendered and compared with the capture."""

from dataclasses import dataclass, replace
from typing import NamedTuple

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.data.capture.capture import Capture, Frame
from diff4splat.errors import ConfigError
from diff4splat.fitting.frames.frame_renderer import FrameRenderer, loss_mask
from diff4splat.fitting.frames.frame_store import FrameStore
from diff4splat.fitting.model.scene_model import SceneModel
from diff4splat.fitting.objective.gradient_statistics import ndc_scale, pinhole_ndc_scale
from diff4splat.fitting.objective.losses import flow_loss, image_loss
from diff4splat.fitting.optics.camera_model import differs_from_pinhole
from diff4splat.fitting.settings import FitSettings
from diff4splat.geometry.physical_camera import PhysicalCamera
from diff4splat.render.api import render
from diff4splat.render.physical.settings import Photograph
from diff4splat.render.settings import RenderSettings
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.scene import Scene


class StepLoss(NamedTuple):
    """Loss of a step, and the tensors that density control needs."""

    loss: Float[Tensor, ""]
    """Mean over the frames, plus regularisers."""
    means: Float[Tensor, "n 3"]
    """Means of the Gaussians; they keep their gradient after the backward pass."""
    ndc_scale: Float[Tensor, " n"]
    """Scene units per half image width at each of them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Objective:
    """Compares a model with the frames of a capture.

    Raises:
        ConfigError: a flow loss is requested for cameras that differ from pinholes.
    """

    renderer: FrameRenderer
    store: FrameStore
    settings: FitSettings

    def __post_init__(self) -> None:
        if self.settings.weights.flow and differs_from_pinhole(self.capture.optics):
            raise ConfigError(
                "weights.flow: expected 0 for cameras with optics, since flow is that of pinholes, "
                f"got {self.settings.weights.flow:g}; leave it out"
            )

    @property
    def capture(self) -> Capture:
        """The ground truth."""
        return self.renderer.capture

    def loss(
        self, model: SceneModel, time_s: float, frames: list[int], degree: int, number: int = 0
    ) -> StepLoss:
        """Loss over ``frames`` in step ``number`` of the fit."""
        scene = model.scene(degree, self.renderer.path)
        if self.renderer.traced:
            terms, means, scale = self._traced_terms(model, scene, time_s, frames, number)
        else:
            terms, means, scale = self._rasterized_terms(scene, time_s, frames)
        if self.settings.weights.flow:
            terms += self._flow_terms(scene, time_s, frames)
        total = torch.stack(terms).sum() / len(frames)
        penalty = model.learned_motion.penalty(model.table, self.settings.weights)
        return StepLoss(total if penalty is None else total + penalty, means, scale)

    def _rasterized_terms(
        self, scene: Scene, time_s: float, frames: list[int]
    ) -> tuple[list[Tensor], Float[Tensor, "n 3"], Float[Tensor, " n"]]:
        """Terms, means at ``time_s`` and their NDC scale."""
        state = scene.state_at(time_s)
        if state.means.requires_grad:
            state.means.retain_grad()
        terms = [self._rasterized_term(state, index) for index in frames]
        cameras = self.capture.cameras[torch.tensor(frames)]
        return terms, state.means, pinhole_ndc_scale(state.means.detach(), cameras)

    def _rasterized_term(self, state: Gaussians, index: int) -> Float[Tensor, ""]:
        frame = self.store.read(index)
        image = self.renderer.rasterize(state, index, self._outputs(frame))
        return image_loss(image, frame, self.settings.weights)

    def _traced_terms(
        self, model: SceneModel, scene: Scene, time_s: float, frames: list[int], number: int
    ) -> tuple[list[Tensor], Float[Tensor, "n 3"], Float[Tensor, " n"]]:
        """Terms, canonical means (rows of a frame may have different times) and NDC scale."""
        learned = model.cameras(learning=number >= self.settings.camera.start)
        cameras = [self.renderer.camera(index, learned) for index in frames]
        terms = [
            self._traced_term(scene, camera, index, number)
            for camera, index in zip(cameras, frames, strict=True)
        ]
        with torch.no_grad():
            scale = ndc_scale(scene.state_at(time_s).means, cameras, time_s)
        return terms, scene.gaussians.means, scale

    def _traced_term(
        self, scene: Scene, camera: PhysicalCamera, index: int, number: int
    ) -> Float[Tensor, ""]:
        frame, weights = self.store.read(index), self.settings.weights
        seed, second_seed = (self.renderer.step_seed(2 * number + part, index) for part in (0, 1))
        photo = self.renderer.learn(scene, camera, index, self._outputs(frame), seed)
        if photo.samples > 1:
            photo = self._with_independent_values(photo, scene, camera, index, second_seed)
        return image_loss(photo, replace(frame, counts=loss_mask(frame, photo.valid)), weights)

    def _with_independent_values(
        self, photo: Photograph, scene: Scene, camera: PhysicalCamera, index: int, seed: int
    ) -> Photograph:
        """Values from a second set of rays, gradients from ``photo``.

        Noise that a residual shares with its derivative has a non-zero mean. It would bias the fit
        towards parameters with less noise, such as another focus distance.
        """
        with torch.no_grad():
            values = self.renderer.learn(scene, camera, index, {"rgb"}, seed).rgb
        return replace(photo, rgb=values + (photo.rgb - photo.rgb.detach()))

    def _outputs(self, frame: Frame) -> set[str]:
        weighted = self.settings.weights.depth and self.settings.use_depth
        return {"rgb", "depth"} if weighted and frame.depth is not None else {"rgb"}

    def _flow_terms(self, scene: Scene, time_s: float, frames: list[int]) -> list[Tensor]:
        """Terms of the frames with ground-truth flow."""
        terms = []
        for index in frames:
            flow = self.store.read(index).flow
            if flow is None:
                continue
            settings = RenderSettings(
                flow_camera=self.capture.cameras[flow.to_frame],
                flow_time_s=float(self.capture.times_s[flow.to_frame]),
            )
            output = render(
                scene,
                self.capture.cameras[index],
                time_s,
                outputs=("flow",),
                settings=settings,
                backend=self.renderer.raster_backend,
            )
            terms.append(self.settings.weights.flow * flow_loss(output.flow, flow))
        return terms
