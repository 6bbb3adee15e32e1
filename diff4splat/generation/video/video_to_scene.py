"""A whole video with its cameras to a scene: the reconstruction alone, without the video model.

Axes: ``f h w`` video frames and pixels.
"""

from dataclasses import replace

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat import __version__
from diff4splat.errors import ShapeError
from diff4splat.generation.inputs.input_image import InputImage
from diff4splat.generation.settings import GenerationSettings
from diff4splat.generation.static_pruning import deformation_threshold_px, prune_static_tracks
from diff4splat.generation.video.canonical_scene import prune_cells
from diff4splat.generation.video.deformation_motion import deform
from diff4splat.generation.video.photometric_steps import Frames, take_photometric_steps
from diff4splat.generation.video.scene_change import cell_rays
from diff4splat.generation.video.video_to_gaussians import VideoLatent, video_gaussians
from diff4splat.geometry.rays import relative_to_first
from diff4splat.models.deformation.keyframes import DeformationUnits
from diff4splat.models.hub.model import Model, model_device, with_parts
from diff4splat.models.ldrm.plane_prior import PLANE_DEPTH
from diff4splat.models.networks import reconstruction_parts
from diff4splat.paths.camera_path import CameraPath
from diff4splat.progress.run_log import RunLog
from diff4splat.scene.scene import Provenance, Scene


@torch.no_grad()
def scene_from_video(
    model: Model,
    video: Float[Tensor, "f h w 3"],
    path: CameraPath,
    settings: GenerationSettings | None = None,
    log: RunLog | None = None,
) -> Scene:
    """The scene that LDRM and the deformation network reconstruct from a true video.

    ``video`` is RGB in [0, 1]; ``path`` holds one camera per frame, lengths in model units. What
    the networks predict is brought nearer to the frames by ``settings.photometric_steps``.

    Raises:
        ShapeError: another number of cameras than frames.
        InputError: frames or size are not what the model can take.
    """
    settings, log = settings or GenerationSettings(), log or RunLog()
    _require_cameras(video, path)
    model.config.latent_grid(len(video), path.cameras.size_px)
    device, model = model_device(model), with_parts(model, reconstruction_parts(model.config))
    # Parts that are read only now lie on the CPU.
    model.networks.to(device)
    seen = _encode(model, video, path)
    with log.phases.phase("reconstruct"):
        canonical = video_gaussians(model, seen, log)
        canonical = prune_cells(canonical, settings.min_opacity, log)
    units = DeformationUnits(length_unit=PLANE_DEPTH, activation=model.config.activation)
    times_s = path.times_s.float().to(seen.latent.device)
    motion = deform(model.networks.deformation, canonical, times_s, units, log)
    camera = seen.cameras[0]
    threshold_px = deformation_threshold_px(model.config, camera, settings.static_threshold_px)
    motion = prune_static_tracks(canonical.gaussians, motion, camera, threshold_px, log)
    scene = Scene(
        gaussians=canonical.gaussians,
        motion=motion,
        path=path.to(torch.float32),
        provenance=_provenance(model),
    )
    rays = cell_rays(canonical, seen.cameras)
    frames = Frames(rgb=video.to(device).float(), path=replace(scene.path, cameras=seen.cameras))
    scene = take_photometric_steps(scene, rays, frames, settings.photometric_steps, log)
    return scene.to(torch.device("cpu"))


def _encode(model: Model, video: Float[Tensor, "f h w 3"], path: CameraPath) -> VideoLatent:
    device = model_device(model)
    cameras = relative_to_first(path.cameras.to(torch.float32)).to(device)
    rgb = video.to(device).float()
    return VideoLatent(
        latent=model.networks.vae.encode(rgb.movedim(-1, 0)[None] * 2 - 1).mean,
        first_frame=InputImage(rgb=rgb[0], camera=cameras[0], focal_source="video"),
        cameras=cameras,
        frames=rgb,
    )


def _provenance(model: Model) -> Provenance:
    parts = reconstruction_parts(model.config)
    return Provenance(
        generator=f"diff4splat {__version__} reconstruction",
        model=model.config.name,
        weights_sha256=model.weights_sha256(parts),
        untrained=not model.trained.issuperset(parts),
    )


def _require_cameras(video: Tensor, path: CameraPath) -> None:
    if len(path) != len(video):
        raise ShapeError(f"path: expected {len(video)} cameras, one per frame, got {len(path)}")
