"""The picture alone, reconstructed, and moved as the motion branch says (docs/adr/0022).

    picture ─┬─ vae ─ ldrm ─ Gaussians ────────────┐
    text ────┴─ motion branch ─ what moves, how ───┴─ key-framed motion

No video is sampled: the sampled one is further from the truth than its draft, and motion does not
wait for it.
"""

from jaxtyping import Float
from torch import Tensor

from diff4splat.flow.guidance import CallCount, Guidance
from diff4splat.generation.input_image import InputImage
from diff4splat.generation.latents_to_gaussians import VideoLatent, canonical_scene
from diff4splat.generation.layered_image.disocclusion import inpaint_disoccluded
from diff4splat.generation.layered_image.rigid_components import rigid_component_offsets
from diff4splat.generation.motion_sampling import MotionRequest, MotionSample, sample_motion
from diff4splat.generation.plane_fallback import base_motion
from diff4splat.generation.reconstruction import Canonical, motion_from_offsets
from diff4splat.generation.settings import why_unguided
from diff4splat.models.config.model import ModelConfig
from diff4splat.models.hub.pretrained import Model
from diff4splat.models.ldrm.refinement.motion_features import key_depth
from diff4splat.paths.camera_path import CameraPath
from diff4splat.progress.run_log import RunLog
from diff4splat.scene.motion.protocol import Motion


def animate_image(
    model: Model, picture: InputImage, context: CameraPath, wish: MotionRequest, log: RunLog
) -> tuple[Canonical, Motion]:
    """Gaussians of ``picture`` and where they go; ``context`` are the cameras of the video."""
    why, saved = "the draft is nearer to the truth", f"the draft, {wish.settings.steps} steps"
    log.record_skipped("sampled video", why, saved)
    with log.phases.phase("reconstruct"):
        latent = model.networks.vae.encode(picture.rgb.movedim(-1, 0)[None, :, None] * 2 - 1).mean
        video = VideoLatent(latent=latent, picture=picture, cameras=context.cameras[:1])
        canonical = canonical_scene(model, video, wish.settings.min_opacity, log)
    frames = model.config.latent_grid(len(context), picture.camera.size_px)[0]
    if frames == 1:
        return canonical, base_motion(context)
    made = _sampled(model, picture, frames, wish, log)
    depth = input_depth(canonical, model.config)
    told = rigid_component_offsets(made.field, made.moving(wish.settings.motion.moves_above), depth)
    goes = told.any(-1).any(0)
    return inpaint_disoccluded(canonical, goes, picture), motion_from_offsets(
        canonical, context.times_s, told
    )


def _sampled(
    model: Model, picture: InputImage, frames: int, wish: MotionRequest, log: RunLog
) -> MotionSample:
    motion = wish.settings.motion
    with log.phases.phase("sample motion", motion.steps) as advance:
        made = sample_motion(model.networks.dit.motion_branch, picture, frames, wish, advance)
    note_guidance(made.calls, wish.text is None, motion.guidance, log)
    return made


def note_guidance(calls: CallCount, unprompted: bool, guidance: Guidance, log: RunLog) -> None:
    """Say which passes of guidance were left out."""
    if calls.saved:
        why = "no prompt" if unprompted else why_unguided(guidance)
        log.record_skipped("guidance pass", why, f"{calls.saved} network calls")


def input_depth(canonical: Canonical, config: ModelConfig) -> Float[Tensor, "h w"]:
    """Depth z of the first picture's pixels."""
    return key_depth(canonical.maps.gaussians[:, -1, :1], config.activation)[0, 0]
