"""One step's loss: pictures of one time, made and compared."""

from dataclasses import dataclass, replace
from typing import NamedTuple

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.data.capture.capture import Capture, Frame
from diff4splat.errors import ConfigError
from diff4splat.fitting.density import flat_half_pictures
from diff4splat.fitting.frame_renderer import Sight, counted, half_pictures
from diff4splat.fitting.losses import flow_loss, picture_loss
from diff4splat.fitting.model import SceneModel
from diff4splat.fitting.optics.camera_model import shows
from diff4splat.fitting.pictures import FrameStore
from diff4splat.fitting.settings import FitSettings
from diff4splat.geometry.physical_camera import PhysicalCamera
from diff4splat.render.api import render
from diff4splat.render.physical.settings import Photograph
from diff4splat.render.settings import RenderSettings
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.scene import Scene


class StepLoss(NamedTuple):
    """What a step learns from."""

    loss: Float[Tensor, ""]
    """Mean over the frames, with regularisers."""
    means: Float[Tensor, "n 3"]
    """Keep the gradients that say where Gaussians are pulled to."""
    half_pictures: Float[Tensor, " n"]
    """Scene units per half picture at each of them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Objective:
    """Compares a model with the frames of a capture.

    Raises:
        ConfigError: flow is asked for, and cameras are more than pinholes.
    """

    sight: Sight
    store: FrameStore
    settings: FitSettings

    def __post_init__(self) -> None:
        if self.settings.weights.flow and shows(self.capture.optics):
            raise ConfigError(
                "weights.flow: expected 0 for cameras with optics, since flow is that of pinholes, "
                f"got {self.settings.weights.flow:g}; leave it out"
            )

    @property
    def capture(self) -> Capture:
        """What is to be explained."""
        return self.sight.capture

    def loss(
        self, model: SceneModel, time_s: float, frames: list[int], degree: int, number: int = 0
    ) -> StepLoss:
        """The loss over ``frames`` in step ``number`` of the fit."""
        scene = model.scene(degree, self.sight.path)
        if self.sight.traced:
            terms, means, lengths = self._photographs(model, scene, time_s, frames, number)
        else:
            state = scene.state_at(time_s)
            if state.means.requires_grad:
                state.means.retain_grad()
            terms = [self._picture(state, index) for index in frames]
            means = state.means
            cameras = self.capture.cameras[torch.tensor(frames)]
            lengths = flat_half_pictures(means.detach(), cameras)
        if self.settings.weights.flow:
            terms += self._flows(scene, time_s, frames)
        total = torch.stack(terms).sum() / len(frames)
        penalty = model.learned.penalty(model.table, self.settings.weights)
        return StepLoss(total if penalty is None else total + penalty, means, lengths)

    def _photographs(
        self, model: SceneModel, scene: Scene, time_s: float, frames: list[int], number: int
    ) -> tuple[list[Tensor], Float[Tensor, "n 3"], Float[Tensor, " n"]]:
        """Terms, the canonical means (nobody else knows all states), and half pictures."""
        known = model.cameras(learning=number >= self.settings.camera.start)
        cameras = [self.sight.camera(index, known) for index in frames]
        terms = [
            self._photograph(scene, camera, index, number)
            for camera, index in zip(cameras, frames, strict=True)
        ]
        with torch.no_grad():
            places = scene.state_at(time_s).means
            lengths = half_pictures(places, cameras, time_s)
        return terms, scene.gaussians.means, lengths

    def _photograph(
        self, scene: Scene, camera: PhysicalCamera, index: int, number: int
    ) -> Float[Tensor, ""]:
        frame, weights = self.store.read(index), self.settings.weights
        seed, other = (self.sight.step_seed(2 * number + part, index) for part in (0, 1))
        made = self.sight.learn(scene, camera, index, self._outputs(frame), seed)
        if made.samples > 1:
            made = self._independent(made, scene, camera, index, other)
        return picture_loss(made, replace(frame, counts=counted(frame, made.valid)), weights)

    def _independent(
        self, made: Photograph, scene: Scene, camera: PhysicalCamera, index: int, seed: int
    ) -> Photograph:
        """The values of other samples with the gradients of ``made``.

        Noise that is in a residual and in its derivative at once has a mean, which would pull at
        whatever makes less noise, such as a focus elsewhere.
        """
        with torch.no_grad():
            values = self.sight.learn(scene, camera, index, {"rgb"}, seed).rgb
        return replace(made, rgb=values + (made.rgb - made.rgb.detach()))

    def _picture(self, state: Gaussians, index: int) -> Float[Tensor, ""]:
        frame = self.store.read(index)
        made = render(
            state,
            self.capture.cameras[index],
            outputs=self._outputs(frame),
            settings=RenderSettings(background=self.sight.background),
            backend=self.sight.drawing,
        )
        return picture_loss(made, frame, self.settings.weights)

    def _outputs(self, frame: Frame) -> set[str]:
        weighted = self.settings.weights.depth and self.settings.use_depth
        return {"rgb", "depth"} if weighted and frame.depth is not None else {"rgb"}

    def _flows(self, scene: Scene, time_s: float, frames: list[int]) -> list[Tensor]:
        """Terms of the frames whose flow is known."""
        found = []
        for index in frames:
            flow = self.store.read(index).flow
            if flow is None:
                continue
            settings = RenderSettings(
                flow_camera=self.capture.cameras[flow.to_frame],
                flow_time_s=float(self.capture.times_s[flow.to_frame]),
            )
            camera = self.capture.cameras[index]
            made = render(
                scene,
                camera,
                time_s,
                outputs=("flow",),
                settings=settings,
                backend=self.sight.drawing,
            )
            found.append(self.settings.weights.flow * flow_loss(made.flow, flow))
        return found
