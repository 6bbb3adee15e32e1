"""A whole video with its cameras to a scene: the reconstruction alone, without the video model.

Axes: ``f h w`` video frames and pixels.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat import __version__
from diff4splat.errors import ShapeError
from diff4splat.generation.input_image import InputImage
from diff4splat.generation.latents_to_gaussians import VideoLatent, canonical_scene
from diff4splat.generation.reconstruction import deform
from diff4splat.generation.settings import GenerationSettings
from diff4splat.generation.static_pruning import prune_static_tracks, static_threshold_px
from diff4splat.geometry.rays import relative_to_first
from diff4splat.models.deformation.keyframes import DeformationUnits
from diff4splat.models.hub.pretrained import Model
from diff4splat.models.ldrm.plane_prior import PLANE_DEPTH
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
    """The scene that LDRM and the deformation network see in a true video.

    ``video`` is RGB in [0, 1]; ``path`` holds one camera per frame, lengths in model units. Colours
    are not matched to the first frame afterwards: what the networks say is what is judged.

    Raises:
        ShapeError: another number of cameras than frames.
        InputError: frames or size are not what the model can take.
    """
    settings, log = settings or GenerationSettings(), log or RunLog()
    _require_cameras(video, path)
    model.config.latent_grid(len(video), path.cameras.size_px)
    cameras = relative_to_first(path.cameras.to(torch.float32)).to(model.device)
    shown = video.to(model.device).float()
    with log.phases.phase("reconstruct"):
        seen = VideoLatent(
            latent=model.networks.vae.encode(shown.movedim(-1, 0)[None] * 2 - 1).mean,
            picture=InputImage(rgb=shown[0], camera=cameras[0], focal_source="video"),
            cameras=cameras,
        )
        canonical = canonical_scene(model, seen, settings.min_opacity, log)
    units = DeformationUnits(length_unit=PLANE_DEPTH, activation=model.config.activation)
    times_s = path.times_s.float().to(model.device)
    scene = Scene(
        gaussians=canonical.gaussians,
        motion=deform(model.networks.deformation, canonical, times_s, units, log),
        path=path.to(torch.float32),
        provenance=_provenance(model),
    )
    still_px = static_threshold_px(model.config, cameras[0], settings.still_px)
    return prune_static_tracks(scene, cameras[0], still_px, log).to(torch.device("cpu"))


def _provenance(model: Model) -> Provenance:
    return Provenance(
        generator=f"diff4splat {__version__} reconstruction",
        model=model.config.name,
        weights_sha256=model.weights_sha256,
        untrained=not model.reconstructs,
    )


def _require_cameras(video: Tensor, path: CameraPath) -> None:
    if len(path) != len(video):
        raise ShapeError(f"path: expected {len(video)} cameras, one per frame, got {len(path)}")
