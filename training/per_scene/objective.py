"""One step's loss: pictures of one time, rendered and compared."""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.data.capture.capture import Capture
from diff4splat.paths.camera_path import CameraPath
from diff4splat.render.api import render
from diff4splat.render.settings import RenderSettings
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.scene import Provenance, Scene
from diff4splat.training.per_scene.losses import flow_loss, picture_loss
from diff4splat.training.per_scene.model import SceneModel
from diff4splat.training.per_scene.pictures import FrameStore
from diff4splat.training.per_scene.settings import FitSettings

UNFINISHED = Provenance(generator="diff4splat fit")


@dataclass(frozen=True, slots=True, kw_only=True)
class Objective:
    """Compares a model with the frames of a capture."""

    capture: Capture
    store: FrameStore
    settings: FitSettings
    backend: str = "auto"

    def loss(
        self, model: SceneModel, time_s: float, frames: list[int], degree: int
    ) -> tuple[Float[Tensor, ""], Gaussians]:
        """Mean over the frames, with regularisers; and the state, whose means keep gradients."""
        motion = model.motion(degree)
        canonical = model.canonical(degree)
        state = motion.state_at(canonical, time_s)
        if state.means.requires_grad:
            state.means.retain_grad()
        terms = [self._picture(state, index) for index in frames]
        if self.settings.weights.flow:
            terms += self._flows(
                Scene(gaussians=canonical, motion=motion, path=self._path(), provenance=UNFINISHED),
                time_s,
                frames,
            )
        total = torch.stack(terms).sum() / len(frames)
        penalty = model.learned.penalty(model.table, self.settings.weights)
        return (total if penalty is None else total + penalty), state

    def _picture(self, state: Gaussians, index: int) -> Float[Tensor, ""]:
        frame = self.store.read(index)
        weights = self.settings.weights
        outputs = {"rgb"}
        if weights.depth and frame.depth is not None and self.settings.use_depth:
            outputs.add("depth")
        made = render(
            state,
            self.capture.cameras[index],
            outputs=outputs,
            settings=RenderSettings(background=self.background),
            backend=self.backend,
        )
        return picture_loss(made, frame, weights)

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
                scene, camera, time_s, outputs=("flow",), settings=settings, backend=self.backend
            )
            found.append(self.settings.weights.flow * flow_loss(made.flow, flow))
        return found

    def _path(self) -> CameraPath:
        """Scenes suggest one; nothing here looks at it."""
        return CameraPath(cameras=self.capture.cameras[:1], times_s=self.capture.times_s[:1])

    @property
    def background(self) -> tuple[float, float, float]:
        """What lies behind the scene."""
        return self.capture.background or (0.0, 0.0, 0.0)
