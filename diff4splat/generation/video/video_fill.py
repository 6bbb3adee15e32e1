"""What the image hides, by the video model and LDRM.

    path ─ views that see most of what is hidden ─┐
    layered image ─ render there ─ VAE ───────────┤
    noise, rays, text ────────────────────────────┴─ DiT ─ latents ─ LDRM ─ hidden cells ─ deform

Axes: ``s d`` text, ``k`` key times. A cell of a later frame is hidden where no layer that the image
shows covers it. Without a depth prior the image has no geometry of its own: then LDRM reconstructs
every cell of every frame of the whole path, which is the paper's way.
"""

from dataclasses import dataclass, replace

import torch
from jaxtyping import Float, Int
from torch import Tensor

from diff4splat.generation.inputs.input_image import InputImage
from diff4splat.generation.layered_image.gaussians import GaussianSet
from diff4splat.generation.layered_image.types import NO_PIXEL, LayeredImage
from diff4splat.generation.settings import GenerationSettings, why_unguided
from diff4splat.generation.static_pruning import deformation_threshold_px, prune_static_tracks
from diff4splat.generation.text_states import TextStates
from diff4splat.generation.video.canonical_scene import (
    CanonicalScene,
    keyframe_plane_prior,
    prune_cells,
    reconstruct,
)
from diff4splat.generation.video.deformation_motion import deform
from diff4splat.generation.video.fill_path import fill_path
from diff4splat.generation.video.hidden_cells import (
    FillGrid,
    at_grid,
    every_nth,
    full_grid,
    hidden_grid,
)
from diff4splat.generation.video.image_condition import image_condition
from diff4splat.generation.video.render_condition import (
    RenderedImage,
    encode_condition,
    render_layered_image,
)
from diff4splat.generation.video.video_sampling import Conditions, sample_video
from diff4splat.generation.video.video_to_gaussians import (
    RawVideoMaps,
    VideoLatent,
    image_plane_base,
    raw_video_maps,
)
from diff4splat.geometry.rays import plucker_map, relative_to_first
from diff4splat.models.config.networks import TIME_STRIDE
from diff4splat.models.deformation.keyframes import DeformationUnits
from diff4splat.models.hub.model import Model
from diff4splat.models.ldrm.plane_prior import PLANE_DEPTH
from diff4splat.paths.camera_path import CameraPath
from diff4splat.progress.run_log import RunLog
from diff4splat.scene.motion.keyframe_algebra import hold_until

FOOTPRINT_CELLS = 0.6
"""Standard deviation of a hidden cell: the scene is drawn without dilation, and cells must meet."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FillRequest:
    """Everything that decides about a fill, at the networks' size."""

    image: InputImage
    layered: LayeredImage
    path: CameraPath
    """Where the video is sampled."""
    key_times_s: Float[Tensor, " k"]
    """Of the image's motion, evenly spread over the whole path."""
    text: TextStates
    seed: int
    settings: GenerationSettings
    hidden_only: bool
    """False where LDRM also reconstructs what the image shows."""


@dataclass(frozen=True, slots=True, kw_only=True)
class VideoFill:
    """Gaussians of the filled cells, and where these lie."""

    gaussians: GaussianSet
    cell_index: Int[Tensor, " n"]
    """The cell of the grid that each one fills."""
    grid: FillGrid


@dataclass(frozen=True, slots=True, kw_only=True)
class _FilledVideo:
    """A sampled video as LDRM sees it."""

    latent: VideoLatent
    rendered: RenderedImage | None


def fill_hidden(model: Model, request: FillRequest, log: RunLog) -> VideoFill | None:
    """Sample a video, and reconstruct what the image does not show of it.

    None where the path sees nothing that the image hides.
    """
    if request.hidden_only:
        with log.phases.phase("choose key frames"):
            path = fill_path(request.layered, request.path)
        if path is None:
            return None
        request = replace(request, path=path)
    video = _sample(model, request, log)
    with log.phases.phase("reconstruct"):
        moving = model.networks.deformation is not None
        raw = raw_video_maps(model, video.latent, moving=moving, log=log)
        grid = _grid(model, request, video, raw)
        config, stride = model.config.activation, request.settings.fill_stride
        footprint = FOOTPRINT_CELLS if request.hidden_only else config.footprint_px
        config = replace(config, footprint_px=stride * footprint)
        canonical = reconstruct(raw.maps, grid.base, config, every_nth(grid.filled, stride))
        least = request.settings.min_opacity
        # Where the image is shown, its own Gaussians are left in any case.
        canonical = prune_cells(canonical, least, log, may_be_empty=request.hidden_only)
    if not len(canonical.gaussians):
        why = "no key frame of this path sees what the image hides"
        log.record_skipped("filled Gaussians", why, "their place in the scene")
    gaussians = _with_motion(model, request, canonical, log)
    return VideoFill(gaussians=gaussians, cell_index=canonical.cell_index, grid=grid)


def _sample(model: Model, request: FillRequest, log: RunLog) -> _FilledVideo:
    settings = request.settings
    if model.networks.dit is None:
        return _condition_as_video(model, request, log)
    rendered, conditions = _conditions(model, request, log)
    with log.phases.phase("sample video", settings.expected_steps) as advance:
        sample = sample_video(model.networks.dit, conditions, settings, request.seed, advance)
    if sample.calls.saved:
        why = "no prompt" if request.text.prompt is None else why_unguided(settings.guidance)
        log.record_skipped("guidance pass", why, f"{sample.calls.saved} network calls")
    latent = VideoLatent(
        latent=sample.latent, first_frame=request.image, cameras=request.path.cameras
    )
    return _FilledVideo(latent=latent, rendered=rendered)


def _condition_as_video(model: Model, request: FillRequest, log: RunLog) -> _FilledVideo:
    """Without a video model: what it would be conditioned on, in place of what it would make."""
    with log.phases.phase("render condition"):
        rendered = render_layered_image(request.layered, request.path, request.key_times_s)
    with log.phases.phase("encode image"):
        latent = encode_condition(model, rendered).latent
    video = VideoLatent(latent=latent, first_frame=request.image, cameras=request.path.cameras)
    return _FilledVideo(latent=video, rendered=rendered)


def _conditions(
    model: Model, request: FillRequest, log: RunLog
) -> tuple[RenderedImage | None, Conditions]:
    conditioned, rendered = model.config.dit.render_condition, None
    if conditioned or request.hidden_only:
        with log.phases.phase("render condition"):
            rendered = render_layered_image(request.layered, request.path, request.key_times_s)
    with log.phases.phase("encode image"):
        image = request.image.rgb.movedim(-1, 0)[None, :, None] * 2 - 1
        image_latent = model.networks.vae.encode(image).mean
        conditions = Conditions(
            image_latent=image_latent,
            plucker=plucker_map(relative_to_first(request.path.cameras)).movedim(0, 1)[None],
            text=request.text.prompt,
            negative_text=request.text.negative,
            image=image_condition(model, image, image_latent, len(request.path)),
            render=encode_condition(model, rendered) if conditioned else None,
        )
    return rendered, conditions


def _grid(model: Model, request: FillRequest, video: _FilledVideo, raw: RawVideoMaps) -> FillGrid:
    """LDRM's grid with the cells to fill."""
    frames = torch.arange(len(request.path))
    if raw.frames is None:
        base = image_plane_base(model, video.latent)
    else:
        rgb, frames = raw.frames.key_rgb[0].movedim(1, -1), frames[::TIME_STRIDE]
        base = keyframe_plane_prior(rgb, raw.frames.key_cameras[0])
    grid = full_grid(raw.maps.gaussians[0], base, model.config.activation)
    if not request.hidden_only:
        return grid
    return hidden_grid(grid, at_grid(video.rendered, frames, model.config.ldrm.grid_stride))


def _with_motion(
    model: Model, request: FillRequest, canonical: CanonicalScene, log: RunLog
) -> GaussianSet:
    units = DeformationUnits(length_unit=PLANE_DEPTH, activation=model.config.activation)
    camera, threshold_px = request.image.camera, request.settings.static_threshold_px
    motion = deform(model.networks.deformation, canonical, request.path.times_s, units, log)
    motion = hold_until(motion, float(request.key_times_s[-1]))
    threshold_px = deformation_threshold_px(model.config, camera, threshold_px)
    return GaussianSet(
        gaussians=canonical.gaussians,
        motion=prune_static_tracks(canonical.gaussians, motion, camera, threshold_px, log),
        pixel_index=_pixel_index(model, request, canonical),
    )


def _pixel_index(model: Model, request: FillRequest, canonical: CanonicalScene) -> Tensor:
    """Cells of the first frame show the image, if LDRM reconstructs them."""
    index = canonical.cell_index
    if request.hidden_only:
        return torch.full_like(index, NO_PIXEL)
    height, width = request.image.camera.size_px
    cells = height * width // model.config.ldrm.grid_stride**2
    return torch.where(index < cells, index, NO_PIXEL)
