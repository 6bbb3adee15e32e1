"""One image, a camera path and optional text to a scene.

Axes: ``b c t h w`` inside networks, pictures ``h w 3`` outside; this file is where they meet.

    picture ─ smaller ─┬─ vae ────┐
                       ├─ draft ──┤   prompt ── text encoder ─┐
                       │          └─── path ─── Plücker maps ─┴─ sample ─ latents, motion ─┐
                       ├─ motion branch ◄── prompt ── motion, and the picture's own latent ┤
                       └─ (or a plane) ────────────────────────────────────────────────────┤
    picture ── finer, match ── Scene ◄── move ◄── prune ◄── reconstruct ◄──────────────────┘

Where the video model sees a draft and tells motion, the picture alone is reconstructed and moved as
told, unless the settings ask for the sampled video as well; if a branch of its own tells motion, no
video is sampled then.
A model of which some parts are trained, but not the video model, shows the picture on its plane,
standing still: see ``Model.runs_video_model``.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import torch
from jaxtyping import Float, Int
from torch import Tensor

from diff4splat import __version__
from diff4splat.generation.color_matching import InputGrid, match_input_view
from diff4splat.generation.image_to_scene import animate_image, input_depth, note_guidance
from diff4splat.generation.input_cameras import (
    reconcile_intrinsics,
    resample_to_model_frames,
    to_camera_path,
)
from diff4splat.generation.input_image import InputImage, downsample, load_image
from diff4splat.generation.latents_to_gaussians import VideoLatent, canonical_scene
from diff4splat.generation.layered_image.guided_upsampling import UpsampledScene, upsample_to_photo
from diff4splat.generation.layered_image.subpixel_infill import add_subpixel_gaussians
from diff4splat.generation.motion_sampling import MotionRequest
from diff4splat.generation.plane_fallback import base_canonical, base_motion, leave_out_video
from diff4splat.generation.reconstruction import Canonical, deform, motion_from_offsets
from diff4splat.generation.render_condition import render_condition_latent
from diff4splat.generation.settings import GenerationSettings, require_seed
from diff4splat.generation.static_pruning import prune_static_tracks, static_threshold_px
from diff4splat.generation.video_sampling import Conditions, SampledVideo, sample_video
from diff4splat.geometry.rays import plucker_map, relative_to_first
from diff4splat.models.deformation.keyframes import DeformationUnits
from diff4splat.models.hub.pretrained import Model, load_model, save_model, with_text_encoder
from diff4splat.models.ldrm.plane_prior import PLANE_DEPTH
from diff4splat.models.motion_unet.motion_field import decode_offsets
from diff4splat.models.text_encoder.prompt import require_prompt
from diff4splat.paths.camera_path import CameraPath
from diff4splat.progress.run_log import RunLog
from diff4splat.scene.motion.protocol import Motion
from diff4splat.scene.scene import DILATION_PX2, Provenance, Scene


@dataclass(frozen=True, slots=True, kw_only=True)
class Request:
    """One generation, validated and at the model's size."""

    picture: InputImage
    path: CameraPath
    prompt: str | None
    seed: int
    settings: GenerationSettings


class Diff4SplatPipeline:
    """All networks of one model, ready to generate."""

    def __init__(self, model: Model) -> None:
        self.model = model

    @classmethod
    def from_pretrained(cls, name_or_folder: str | Path) -> "Diff4SplatPipeline":
        """A model folder, or the name of a size: its shipped weights, else random ones.

        Scenes are marked untrained until every part of the model is trained.

        Raises:
            ConfigError: no such size, or it does not fit into this machine's memory.
            CheckpointError: the folder's weights do not belong to its configuration.
            FileFormatError: a file is damaged.
        """
        return cls(load_model(name_or_folder))

    def to(self, device: torch.device | str) -> "Diff4SplatPipeline":
        """Move the networks; scenes always come back to the CPU."""
        self.model.networks.to(torch.device(device))
        return self

    def save_pretrained(self, folder: Path | str) -> None:
        """Write configuration, weights and provenance into ``folder``."""
        save_model(self.model, Path(folder))

    @torch.no_grad()
    def __call__(
        self,
        image: InputImage | Path | str,
        path: CameraPath | str,
        prompt: str | None = None,
        *,
        seed: int = 0,
        settings: GenerationSettings | None = None,
        log: RunLog | None = None,
    ) -> Scene:
        """Generate a scene; equal arguments give equal bits on one machine.

        Args:
            image: a photograph's file, or a prepared ``InputImage``.
            path: cameras, or presets such as ``spiral+forward``; becomes the suggested path.
            prompt: what happens; None leaves the text encoder and the guidance pass out. Says
                nothing to a model whose video model is left out.
            seed: of the noise that the video starts from.
            settings: sampling, guidance and pruning.
            log: collects seconds and what was left out.

        Raises:
            InputError: the image, the path or the prompt cannot be used.
        """
        require_seed(seed)
        picture = self._picture(image)
        picture, path = reconcile_intrinsics(picture, to_camera_path(path, picture.camera))
        request = Request(
            picture=picture,
            path=path,
            prompt=prompt,
            seed=seed,
            settings=settings or GenerationSettings(),
        )
        return self._generate(request, log or RunLog())

    def _picture(self, image: InputImage | Path | str) -> InputImage:
        """At a size that the model can take, in single precision."""
        config = self.model.config
        if not isinstance(image, InputImage):
            side_px = self.model.side_px
            multiple_px = config.token_px * self.model.pixels_per_cell((side_px, side_px))
            image = load_image(Path(image), side_px, multiple_px=multiple_px)
        config.latent_grid(config.frames, image.camera.size_px)
        return replace(image, rgb=image.rgb.float(), camera=image.camera.to(torch.float32))

    def _generate(self, request: Request, log: RunLog) -> Scene:
        device, photo = self.model.device, request.picture.to(self.model.device)
        small = downsample(photo, self.model.pixels_per_cell(photo.camera.size_px))
        context = resample_to_model_frames(request.path, self.model.config.frames).to(device)
        context = replace(context, cameras=context.cameras.resized(small.camera.size_px))
        build = self._from_video if self.model.runs_video_model else self._from_picture
        canonical, motion = build(replace(request, picture=small), context, log)
        fine = _fine(canonical, motion, small, photo)
        scene = Scene(
            gaussians=fine.gaussians,
            motion=fine.motion,
            path=request.path,
            provenance=self._provenance(request),
            # Pixels as they are have all the blur they need.
            dilation_px2=0.0 if canonical.is_picture else DILATION_PX2,
        )
        request = replace(request, picture=photo)
        scene = self._match_colors(scene, fine.cells, request, log)
        still_px = static_threshold_px(self.model.config, photo.camera, request.settings.still_px)
        return prune_static_tracks(scene, photo.camera, still_px, log).to(torch.device("cpu"))

    def _from_video(
        self, request: Request, context: CameraPath, log: RunLog
    ) -> tuple[Canonical, Motion]:
        """What the networks make of the picture."""
        if self.model.branches_motion and request.settings.pictures == "first":
            text = self._text_states(request.prompt, log)
            wish = MotionRequest(text=text, seed=request.seed, settings=request.settings)
            return animate_image(self.model, request.picture, context, wish, log)
        made = self._sample(request, self._conditions(request, context, log), log)
        video = VideoLatent(latent=made.latent, picture=request.picture, cameras=context.cameras)
        alone = self.model.tells_motion and request.settings.pictures == "first"
        if alone:
            video = replace(video, latent=made.latent[:, :, :1], cameras=context.cameras[:1])
        with log.phases.phase("reconstruct"):
            canonical = canonical_scene(self.model, video, request.settings.min_opacity, log)
        told = self._told(canonical, made, request.picture)
        if alone and told is not None:
            log.record_skipped(
                "sampled pictures", "the draft is nearer to the truth", "later key frames"
            )
            return canonical, motion_from_offsets(canonical, context.times_s, told)
        return canonical, self._motion(canonical, context, told, log)

    def _told(
        self, canonical: Canonical, made: SampledVideo, picture: InputImage
    ) -> Float[Tensor, "t h w 3"] | None:
        """What the video model says of motion, if it says something and there is room for it."""
        if not self.model.config.dit.motion or made.motion.shape[2] < 2:
            return None
        depth = input_depth(canonical, self.model.config)
        return decode_offsets(made.motion, picture.rgb, depth)

    def _from_picture(
        self, request: Request, context: CameraPath, log: RunLog
    ) -> tuple[Canonical, Motion]:
        """The base scene, without any network."""
        config, settings = self.model.config, request.settings
        if request.prompt is not None:
            require_prompt(request.prompt, config.text.max_bytes)
        leave_out_video(request.prompt, settings.steps, log)
        canonical = base_canonical(request.picture, context, config, settings.min_opacity, log)
        return canonical, base_motion(context)

    def _conditions(self, request: Request, context: CameraPath, log: RunLog) -> Conditions:
        text = self._text_states(request.prompt, log)
        with log.phases.phase("encode image"):
            plucker = plucker_map(relative_to_first(context.cameras)).movedim(0, 1)[None]
            video = request.picture.rgb.movedim(-1, 0)[None, :, None] * 2 - 1
            image_latent = self.model.networks.vae.encode(video).mean
        return Conditions(
            image_latent=image_latent,
            plucker=plucker,
            text=text,
            draft=self._draft(request, context, log),
        )

    def _draft(
        self, request: Request, context: CameraPath, log: RunLog
    ) -> Float[Tensor, "1 c t h w"] | None:
        if not self.model.config.dit.draft:
            return None
        with log.phases.phase("draft"):
            return render_condition_latent(self.model, request.picture, context.cameras)

    def _text_states(self, prompt: str | None, log: RunLog) -> Float[Tensor, "1 s d"] | None:
        if prompt is None:
            built = self.model.networks.text_encoder is not None
            saved = "one call" if built else "the whole network: it was not built"
            log.record_skipped("text encoder", "no prompt", saved)
            return None
        require_prompt(prompt, self.model.config.text.max_bytes)
        with log.phases.phase("encode text"):
            self.model = with_text_encoder(self.model)
            return self.model.networks.text_encoder.encode_prompt(prompt)

    def _sample(self, request: Request, conditions: Conditions, log: RunLog) -> SampledVideo:
        settings, dit = request.settings, self.model.networks.dit
        with log.phases.phase("sample video", settings.steps) as advance:
            video = sample_video(dit, conditions, settings, request.seed, advance)
        note_guidance(video.calls, conditions.text is None, settings.guidance, log)
        return video

    def _motion(
        self, canonical: Canonical, context: CameraPath, told: Tensor | None, log: RunLog
    ) -> Motion:
        units = DeformationUnits(length_unit=PLANE_DEPTH, activation=self.model.config.activation)
        return deform(self.model.networks.deformation, canonical, context.times_s, units, log, told)

    def _match_colors(
        self, scene: Scene, cells: Int[Tensor, " n"], request: Request, log: RunLog
    ) -> Scene:
        grid = InputGrid(
            picture=request.picture, stride=self.model.config.ldrm.grid_stride, cells=cells
        )
        return match_input_view(scene, grid, request.settings.color_steps, log)

    def _provenance(self, request: Request) -> Provenance:
        return Provenance(
            generator=f"diff4splat {__version__}",
            model=self.model.config.name,
            weights_sha256=self.model.weights_sha256,
            seed=request.seed,
            prompt=request.prompt,
            untrained=self.model.untrained,
        )


def _fine(
    canonical: Canonical, motion: Motion, small: InputImage, photo: InputImage
) -> UpsampledScene:
    """What networks made of ``small``, as fine as ``photo``; one picture has no gaps."""
    fine = UpsampledScene(
        gaussians=canonical.gaussians,
        motion=motion,
        cells=canonical.every_cell,
        pixels=len(canonical.cells),
    )
    if small is not photo:
        fine = upsample_to_photo(canonical, motion, small, photo)
    return add_subpixel_gaussians(fine, photo) if canonical.is_picture else fine
