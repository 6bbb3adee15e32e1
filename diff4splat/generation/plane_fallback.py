"""The base scene by itself: what generation shows when it leaves its networks out.

It is exactly what fresh heads would make, because they answer 0 to any video and 0 means the base.
"""

from jaxtyping import Float
from torch import Tensor

from diff4splat.generation.input_image import InputImage
from diff4splat.generation.reconstruction import Canonical, prune_cells, reconstruct
from diff4splat.models.config.model import ModelConfig
from diff4splat.models.config.networks import GAUSSIAN_SPLIT
from diff4splat.models.ldrm.plane_prior import plane_base
from diff4splat.models.ldrm.raw_maps import RawGaussianMaps
from diff4splat.paths.camera_path import CameraPath
from diff4splat.progress.run_log import RunLog
from diff4splat.scene.motion.static import StaticMotion

UNTRAINED_VIDEO = "the video model is not trained"


def base_canonical(
    picture: InputImage, context: CameraPath, config: ModelConfig, min_opacity: float, log: RunLog
) -> Canonical:
    """Gaussians of the photograph on its plane, those below ``min_opacity`` dropped."""
    with log.phases.phase("reconstruct"):
        base = plane_base(picture.rgb, picture.camera, context.cameras, config.ldrm.grid_stride)
        raw = base.distance.new_zeros(1, sum(GAUSSIAN_SPLIT), *base.distance.shape)
        maps = RawGaussianMaps(gaussians=raw, tokens=_no_tokens(raw))
        return prune_cells(reconstruct(maps, base, config.activation), min_opacity, log)


def base_motion(context: CameraPath) -> StaticMotion:
    """Nothing moves, for as long as the path lasts."""
    return StaticMotion(time_range_s=(float(context.times_s[0]), float(context.times_s[-1])))


def leave_out_video(prompt: str | None, steps: int, log: RunLog) -> None:
    """Tell which networks did not run, and that a prompt says nothing to the others."""
    if prompt is not None:
        log.record_skipped("text encoder", UNTRAINED_VIDEO, "the whole network: it was not built")
    saved = f"{steps} steps of the sampler and four networks"
    log.record_skipped("video model and reconstruction", UNTRAINED_VIDEO, saved)


def _no_tokens(raw: Float[Tensor, "1 c t h w"]) -> Float[Tensor, "1 0 0 0 0"]:
    """Nobody deforms the base scene."""
    return raw.new_zeros(1, 0, 0, 0, 0)
