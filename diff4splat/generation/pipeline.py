"""One image, a camera path and optional text to a scene.

Axes: ``b c t h w`` inside networks, images ``h w 3`` outside; this file is where they meet.

    plan ─ load its networks
    image ─ smaller copy ─ priors: depth, displacement ─ layered image ─┬─ Gaussians ─┐
    path, text, layered image ─ video fill (if planned) ── hidden cells ┘             │
    scene ◄─ match colours ◄─ combine ◄──────────────────────────────────────────────┘
"""

from collections.abc import Collection
from dataclasses import replace
from pathlib import Path
from typing import Literal

import torch

from diff4splat import __version__
from diff4splat.generation.color_matching import InputView, match_input_view
from diff4splat.generation.given_depth.source import DepthSource
from diff4splat.generation.inputs.copies import Copies
from diff4splat.generation.inputs.input_image import InputImage
from diff4splat.generation.inputs.request import (
    Request,
    UserInput,
    prepare_request,
    sized_to_depth,
)
from diff4splat.generation.layered_image.build import build_layered_image
from diff4splat.generation.layered_image.gaussians import GaussianSet, image_gaussians
from diff4splat.generation.layered_image.inpainting import Inpaint, NetworkInpainting
from diff4splat.generation.layered_image.pixel_maps.image_maps import ImageMaps
from diff4splat.generation.motion.local_motion.gaussians import with_local_motion
from diff4splat.generation.object_shadow.gaussians import with_shadows
from diff4splat.generation.one_thread import one_thread
from diff4splat.generation.plan import FILL_PARTS, GenerationPlan
from diff4splat.generation.priors import image_maps
from diff4splat.generation.scene_assembly import combine
from diff4splat.generation.settings import GenerationSettings
from diff4splat.generation.static_pruning import prune_static_tracks
from diff4splat.generation.text_states import TextStates, encode_text, motion_requests
from diff4splat.generation.video.video_fill import FillRequest, fill_hidden
from diff4splat.generation.visible_fill import without_visible
from diff4splat.models.hub.model import Model, load_model, save_model, with_adapter, with_parts
from diff4splat.models.placement.resident import keep_blocks
from diff4splat.paths.camera_path import CameraPath
from diff4splat.paths.preset_path import PresetPath
from diff4splat.progress.run_log import RunLog
from diff4splat.scene.scene import DILATION_PX2, Provenance, Scene

UNKNOWN_LICENSE = "unknown"
Dtype = Literal["float32", "bfloat16", "float16"]


class Diff4SplatPipeline:
    """One model, of which each generation loads the networks that it needs."""

    def __init__(self, model: Model) -> None:
        self.model = model
        self.device = torch.device("cpu")
        self.dtype = torch.float32

    @classmethod
    def from_pretrained(
        cls, name_or_folder: str | Path, lora: Path | str | None = None
    ) -> "Diff4SplatPipeline":
        """A model folder, or the name of a size: its bundled weights, else random ones.

        ``lora`` is a folder with what a stage taught the video model beside its own weights.

        Weights are read when a generation needs them. Scenes are marked untrained if a network
        that ran is not trained.

        Raises:
            ConfigError: no such size.
            CheckpointError, FileFormatError: the folder's configuration cannot be used.
        """
        model = load_model(name_or_folder, parts=())
        return cls(model if lora is None else with_adapter(model, Path(lora)))

    def to(self, device: torch.device | str, dtype: Dtype = "float32") -> "Diff4SplatPipeline":
        """Run networks there and in that precision; scenes come back to the CPU in float32."""
        self.device, self.dtype = torch.device(device), getattr(torch, dtype)
        return self

    def save_pretrained(self, folder: Path | str) -> None:
        """Write configuration, weights and provenance into ``folder``."""
        save_model(self.model, Path(folder))

    @torch.no_grad()
    def __call__(
        self,
        image: InputImage | Path | str,
        path: CameraPath | PresetPath | str,
        prompt: str | None = None,
        *,
        seed: int = 0,
        settings: GenerationSettings | None = None,
        log: RunLog | None = None,
        depth: DepthSource | None = None,
    ) -> Scene:
        """Generate a scene; equal arguments give equal bits on one machine.

        Args:
            image: a photograph's file, or a prepared ``InputImage``.
            path: cameras, or presets such as ``spiral+forward``, sized to the depth of the image;
                becomes the suggested path.
            prompt: what moves; without one nothing does.
            seed: of the noise that sampling starts from.
            settings: sampling, guidance, filling and pruning.
            log: collects seconds and what was skipped.
            depth: takes the place of the model's depth prior (``open_depth``).

        Raises:
            InputError: the image, the path or the prompt cannot be used.
            ConfigError: a setting that this model cannot satisfy.
            CheckpointError, FileFormatError: weights that are needed cannot be read.
        """
        log = log or RunLog()
        user = UserInput(
            image=image,
            path=path,
            prompt=prompt,
            seed=seed,
            settings=settings or GenerationSettings(),
            depth=depth,
        )
        request = prepare_request(self.model, user, self.device)
        request.plan.record(self.model, log)
        with log.phases.phase("load networks"):
            self.model = with_parts(self.model, request.plan.parts)
            self.model.networks.to(self.device)
            if self.model.runtime == "torch":
                keep_blocks((part for _, part in self.model.networks.parts()), self.device)
        return self.generate(request, log)

    @torch.no_grad()
    def generate(self, request: Request, log: RunLog) -> Scene:
        """A prepared request, with its networks loaded."""
        model = self._running(request.plan)
        copies = Copies(image=request.image, small=request.small, depth=request.depth)
        size_px = request.small.camera.size_px
        frames = model.config.latent_grid(len(request.small_path), size_px)[0]
        with one_thread(), self._autocast():
            text = encode_text(request, model, log)
            maps = image_maps(model, copies, frames, motion_requests(request, text), log)
        request = sized_to_depth(request, maps.depth)
        gaussians = self._gaussians(request, maps, text, log)
        scene = Scene(
            gaussians=gaussians.gaussians,
            motion=gaussians.motion,
            path=request.path,
            provenance=self._provenance(request),
            # The image's own pixels are drawn as they are: they have all the blur they need.
            dilation_px2=0.0 if request.plan.shows_image else DILATION_PX2,
        )
        view = InputView(
            rgb=request.image.rgb,
            camera=request.image.camera,
            pixel_index=gaussians.pixel_index,
            stride=1 if request.plan.shows_image else model.config.ldrm.grid_stride,
        )
        steps = request.settings.color_matching_steps
        return match_input_view(scene, view, steps, log).to(torch.device("cpu"))

    def _gaussians(
        self, request: Request, maps: ImageMaps, text: TextStates, log: RunLog
    ) -> GaussianSet:
        """Those of the image, of the video model's fill, or of both."""
        if not request.plan.fills:
            return self._image_gaussians(request, maps, log)[0]
        with self._autocast():
            fill = fill_hidden(
                self._running(request.plan), self._fill_request(request, maps, text), log
            )
        if not request.plan.shows_image:
            return fill.gaussians
        image, visible_count = self._image_gaussians(request, maps, log)
        if fill is None:
            log.record_unused(FILL_PARTS, "the image shows all that the path sees")
            return image
        fill = without_visible(fill, image, request.image.camera)
        return combine(image, visible_count, fill)

    def _image_gaussians(
        self, request: Request, maps: ImageMaps, log: RunLog
    ) -> tuple[GaussianSet, int]:
        """The layered image's, and how many of them the image shows."""
        with log.phases.phase("layer image"):
            layered = build_layered_image(
                request.small,
                request.image,
                maps,
                self.model.config.refinement.border_cells,
                infill=request.settings.subpixel_infill,
                inpaint=self._inpaint(request),
            )
            if not request.settings.extended_layers:
                layered = layered.visible
            found = image_gaussians(layered, request.key_times_s)
            visible_count = layered.visible_count
            if maps.objects is not None:
                found, visible_count = with_local_motion(found, layered, maps.objects)
            found = with_shadows(found, layered, maps.shadows, request.key_times_s)
        threshold_px, camera = request.settings.static_threshold_px, request.image.camera
        motion = prune_static_tracks(found.gaussians, found.motion, camera, threshold_px, log)
        return replace(found, motion=motion), visible_count

    def _inpaint(self, request: Request) -> Inpaint | None:
        """By the network, if it runs."""
        if "image_inpainting" not in request.plan.parts:
            return None
        return NetworkInpainting(network=self.model.networks.image_inpainting)

    def _fill_request(self, request: Request, maps: ImageMaps, text: TextStates) -> FillRequest:
        border_cells = self.model.config.refinement.border_cells
        return FillRequest(
            image=request.small,
            layered=build_layered_image(request.small, request.small, maps, border_cells),
            path=request.small_path,
            key_times_s=request.key_times_s,
            text=text,
            seed=request.seed,
            settings=request.settings,
            hidden_only=request.plan.shows_image,
        )

    def _running(self, plan: GenerationPlan) -> Model:
        """The model with the networks of the plan alone; others may be loaded from before."""
        idle = {part: None for part in self.model.loaded if part not in plan.parts}
        return replace(self.model, networks=replace(self.model.networks, **idle))

    def _autocast(self) -> torch.autocast:
        """Networks in half precision where that was asked for."""
        half = self.dtype != torch.float32
        dtype = self.dtype if half else None
        return torch.autocast(self.device.type, dtype, enabled=half)

    def _provenance(self, request: Request) -> Provenance:
        return Provenance(
            generator=f"diff4splat {__version__}",
            model=self.model.config.name,
            weights_sha256=self.model.weights_sha256(request.plan.parts),
            seed=request.seed,
            prompt=request.prompt,
            license=self._license(request.plan.parts),
            untrained=not self.model.trained.issuperset(request.plan.parts),
        )

    def _license(self, parts: Collection[str]) -> str:
        """That of the weights that ran; a scene of no trained network has none."""
        return self.model.license if self.model.trained.intersection(parts) else UNKNOWN_LICENSE
