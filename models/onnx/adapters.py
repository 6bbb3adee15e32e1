"""ONNX graphs with the calls of the PyTorch networks (``protocols``); tensors in and out.

The exporter (``onnx_export``) names every graph and tensor that is used here. Axes as in the
networks' modules.
"""

from collections.abc import Iterable, Iterator

import torch
from torch import Tensor

from diff4splat.errors import ConfigError
from diff4splat.models.config.model import ModelConfig
from diff4splat.models.config.networks import TIME_STRIDE
from diff4splat.models.ldrm.raw_maps import RawGaussianMaps
from diff4splat.models.ldrm.refinement.motion_features import motion_features
from diff4splat.models.ldrm.refinement.posed_video import PosedVideo
from diff4splat.models.onnx.graph import OnnxGraph, OnnxModel
from diff4splat.models.onnx.shapes import shape_of
from diff4splat.models.text_encoder.prompt import token_row
from diff4splat.models.video_dit.conditions import DitConditions, RenderCondition
from diff4splat.models.video_vae.latent_distribution import LatentDistribution


def run_graph(graph: OnnxGraph, inputs: dict[str, Tensor | None]) -> dict[str, Tensor]:
    """Outputs for tensors; inputs that the graph does not take are left out."""
    taken = {spec.name for spec in graph.entry.inputs}
    arrays = {
        name: tensor.detach().numpy()
        for name, tensor in inputs.items()
        if tensor is not None and name in taken
    }
    return {name: torch.from_numpy(array) for name, array in graph(arrays).items()}


class OnnxPart:
    """What all graphs have in common: they stay on the CPU."""

    def __init__(self, model: OnnxModel, config: ModelConfig) -> None:
        self.model, self.config = model, config

    def to(self, target: torch.device | torch.dtype) -> "OnnxPart":
        """Nothing to move.

        Raises:
            ConfigError: another device than the CPU.
        """
        if isinstance(target, torch.device) and target.type != "cpu":
            raise ConfigError(f"device of ONNX graphs: expected cpu, got {target}; use cpu")
        return self


class OnnxTextEncoder(OnnxPart):
    """As ``TextEncoder``."""

    def encode_prompt(self, text: str) -> Tensor:
        """States of one prompt."""
        tokens = torch.tensor([token_row(text, self.config.text.max_bytes)])
        inputs = {"tokens": tokens, "mask": torch.ones_like(tokens, dtype=torch.bool)}
        return run_graph(self.model["text_encoder"], inputs)["states"]


class OnnxDepth(OnnxPart):
    """As ``MonocularDepthNet``."""

    def __call__(self, image: Tensor) -> Tensor:
        """Raw ray distance of every pixel."""
        return run_graph(self.model["monocular_depth"], {"image": image})["raw_distance"]

    def predict_distance_and_uncertainty(self, image: Tensor) -> tuple[Tensor, Tensor | None]:
        """By every encoder, or by all together where the graph does not part them."""
        found = run_graph(self.model["monocular_depth"], {"image": image})
        return found.get("per_encoder", found["raw_distance"]), found.get("log_uncertainty")


class OnnxMotion(OnnxPart):
    """As ``MotionUNet``."""

    def __call__(
        self,
        image: Tensor,
        noisy: Tensor,
        level: Tensor,
        text: Tensor | None = None,
        text_mask: Tensor | None = None,
        object_mask: Tensor | None = None,
    ) -> Tensor:
        """The clean motion."""
        return self.predict_motion_and_mask(image, noisy, level, text, text_mask, object_mask)[0]

    def predict_motion_and_mask(
        self,
        image: Tensor,
        noisy: Tensor,
        level: Tensor,
        text: Tensor | None = None,
        text_mask: Tensor | None = None,
        object_mask: Tensor | None = None,
    ) -> tuple[Tensor, Tensor]:
        """The clean motion, and for every pixel the logit that it moves."""
        text, text_mask = text_or_none(text, text_mask, len(image), self.config.text.width)
        inputs = {"image": image, "noisy": noisy, "level": level}
        inputs |= {"text": text, "text_mask": text_mask}
        if self.config.motion_unet.object_mask:
            absent = image.new_zeros(len(image), *image.shape[2:])
            inputs["object_mask"] = absent if object_mask is None else object_mask
        found = run_graph(self.model["motion_unet"], inputs)
        return found["motion"], found["mask_logits"]


class OnnxObjectMask(OnnxPart):
    """As ``ObjectMaskNet``."""

    def __call__(self, image: Tensor, text: Tensor, text_mask: Tensor | None = None) -> Tensor:
        """For every pixel the logit that the prompt asks it to move."""
        return self.predict_mask_and_instances(image, text, text_mask)[0]

    def predict_mask_and_instances(
        self, image: Tensor, text: Tensor, text_mask: Tensor | None = None
    ) -> tuple[Tensor, Tensor | None]:
        """The logits, and vectors that separate instances, if it has any."""
        text, text_mask = text_or_none(text, text_mask, len(image), self.config.text.width)
        inputs = {"image": image, "text": text, "text_mask": text_mask}
        found = run_graph(self.model["object_mask"], inputs)
        return found["mask_logits"], found.get("instances")


class OnnxImageClassifier(OnnxPart):
    """As ``ImageClassifier``."""

    def __call__(self, image: Tensor, mask_logits: Tensor, classes: Tensor) -> Tensor:
        """Logits of an object mask, corrected where prompts name classes."""
        inputs = {"image": image, "mask_logits": mask_logits, "classes": classes}
        return run_graph(self.model["image_classifier"], inputs)["corrected_logits"]


class OnnxObjectShadow(OnnxPart):
    """As ``ObjectShadowNet``."""

    def __call__(self, image: Tensor, mask: Tensor) -> Tensor:
        """For every pixel how much darker the object of the mask makes it."""
        return run_graph(self.model["object_shadow"], {"image": image, "mask": mask})["darkening"]


class OnnxImageInpainting(OnnxPart):
    """As ``ImageInpainting``."""

    @property
    def multiple_px(self) -> int:
        """What sides are multiples of."""
        return self.config.image_inpainting.multiple_px

    def __call__(self, image: Tensor, known: Tensor) -> Tensor:
        """The image where it is known, completed elsewhere."""
        inputs = {"image": image, "known": known}
        return run_graph(self.model["image_inpainting"], inputs)["completed"]


class OnnxVae(OnnxPart):
    """As ``VideoVae``."""

    def encode(self, video: Tensor) -> LatentDistribution:
        """Standardised latents."""
        found = run_graph(self.model["vae_encoder"], {"video": video})
        return LatentDistribution(mean=found["mean"], log_variance=found["log_variance"])

    def decode(self, latent: Tensor) -> Tensor:
        """Video of 1 + 4 (t − 1) frames, one latent frame after the other."""
        graph, frames = self.model["vae_decoder"], []
        caches = self._black(graph, latent)
        for frame in latent.split(1, 2):
            found = run_graph(graph, {"latent": frame, **caches})
            frames.append(found.pop("video"))
            caches = {name.removeprefix("next_"): tensor for name, tensor in found.items()}
        return torch.cat(frames, 2)[:, :, TIME_STRIDE - 1 :]

    def _black(self, graph: OnnxGraph, latent: Tensor) -> dict[str, Tensor]:
        """The caches before the first chunk."""
        sizes = dict(
            zip(("batch", "rows", "columns"), (len(latent), *latent.shape[3:]), strict=True)
        )
        caches = [spec for spec in graph.entry.inputs if spec.name != "latent"]
        return {spec.name: torch.zeros(shape_of(spec.shape, sizes)) for spec in caches}


class OnnxDit(OnnxPart):
    """As ``VideoDiT``."""

    def prepare(
        self,
        camera: Tensor | None = None,
        text: Tensor | None = None,
        text_mask: Tensor | None = None,
        condition: RenderCondition | None = None,
    ) -> DitConditions:
        """Embed the conditions once for all steps of a sampler."""
        given = text is not None
        text, text_mask = text_or_none(text, text_mask, len(camera), self.config.text.width)
        inputs = {"camera": camera, "text": text, "text_mask": text_mask}
        if condition is not None:
            inputs |= {"render_latent": condition.latent, "validity": condition.validity}
        found = run_graph(self.model["dit_conditions"], inputs)
        return DitConditions(
            camera=found["camera_tokens"],
            text=found["text_states"] if given else None,
            text_mask=text_mask if given else None,
            pooled_text=found.get("pooled_text") if given else None,
            render_latent=None if condition is None else condition.latent,
            render_tokens=found.get("render_tokens"),
        )

    def velocity(self, latent: Tensor, level: Tensor, conditions: DitConditions) -> Tensor:
        """Velocity at a noise level per latent frame."""
        batch, width = len(latent), self.config.dit.width
        text, mask = text_or_none(conditions.text, conditions.text_mask, batch, width)
        pooled = conditions.pooled_text
        inputs = {
            "latent": latent,
            "level": level,
            "camera_tokens": conditions.camera,
            "text_states": text,
            "text_mask": mask,
            "pooled_text": torch.zeros(batch, width) if pooled is None else pooled,
            "render_latent": conditions.render_latent,
            "render_tokens": conditions.render_tokens,
        }
        return run_graph(self.model["dit_velocity"], inputs)["velocity"]


class OnnxLdrm(OnnxPart):
    """As ``Ldrm``."""

    def __call__(
        self,
        latent: Tensor,
        camera: Tensor,
        posed_video: PosedVideo | None = None,
        *,
        moving: bool = True,
    ) -> RawGaussianMaps:
        """Raw maps of the video's frames."""
        inputs = {"latent": latent, "camera": camera}
        if posed_video is not None:
            inputs |= posed_inputs(posed_video)
        found = run_graph(self.model["ldrm"], inputs)
        gaussians, tokens = found["gaussians"], found["tokens"]
        if moving and self.config.refinement.used:
            features, config = tokens.transpose(1, 2), self.config.activation
            tokens = motion_features(
                features, gaussians[:, -1], posed_video, config, self._optical_flow
            )
        return RawGaussianMaps(gaussians=gaussians, tokens=tokens, border=found.get("border"))

    def _optical_flow(self, source: Tensor, target: Tensor, start: Tensor) -> Tensor:
        inputs = {"source": source, "target": target, "start": start}
        return run_graph(self.model["ldrm_optical_flow"], inputs)["flow"]


class OnnxDeformation(OnnxPart):
    """As ``DeformationNetwork``."""

    def is_identity(self) -> bool:
        """Weights are not looked at."""
        return False

    def at_times(self, tokens: Tensor, times: Iterable[Tensor]) -> Iterator[Tensor]:
        """Raw deformation at one time after the other."""
        for time in times:
            yield run_graph(self.model["deformation"], {"tokens": tokens, "time": time})["raw"]


def posed_inputs(video: PosedVideo) -> dict[str, Tensor]:
    """Frames, cameras and distances under the names that graphs have for them."""
    cameras, start = video.cameras, video.start_or_plane()
    return {
        "rgb": video.rgb,
        "focal_px": cameras.focal_px,
        "center_px": cameras.center_px,
        "world_from_camera": cameras.world_from_camera,
        "prior": start.prior,
        "parallax": start.parallax,
        "confidence": start.confidence,
    }


def text_or_none(
    text: Tensor | None, mask: Tensor | None, batch: int, width: int
) -> tuple[Tensor, Tensor]:
    """Text and mask as graphs take them: one token that is not real stands for no text."""
    if text is None:
        return torch.zeros(batch, 1, width), torch.zeros(batch, 1, dtype=torch.bool)
    if mask is None:
        mask = torch.ones(text.shape[:2], dtype=torch.bool)
    return text, mask
