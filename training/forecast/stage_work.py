"""What one sample of a stage runs: networks with and without gradients, renders."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from diff4splat.errors import ConfigError
from diff4splat.models.config.model import ModelConfig
from diff4splat.training.forecast.operations import ENCODE, Operations, SampleShape, count
from diff4splat.training.recipe.kinds import StageKind
from diff4splat.training.recipe.stage import StageRecipe

Calls = tuple[tuple[str, int, int], ...]
"""Network, calls without gradients, calls of the objective."""
TIMES = -1
"""As many calls as there are target times."""
CALLS: Mapping[StageKind, Calls] = MappingProxyType(
    {
        "vae": (("vae", 0, 1),),
        "static": ((ENCODE, 1, 0), ("ldrm", 0, 1)),
        "dynamic": ((ENCODE, 1, 0), ("ldrm", 0, 1), ("deformation", 0, TIMES)),
        "video_diffusion": ((ENCODE, 1, 0), ("text_encoder", 0, 1), ("dit", 0, 1)),
        "joint": (
            (ENCODE, 1, 0),
            ("text_encoder", 1, 1),
            ("dit", 2, 1),
            ("ldrm", 0, 1),
            ("deformation", 0, TIMES),
        ),
    }
)
RENDERING = ("static", "dynamic", "joint")


@dataclass(frozen=True, slots=True, kw_only=True)
class NetworkWork:
    """Calls of one network for one sample."""

    name: str
    once: Operations
    plain: int
    trained: int

    def flops(self, recompute: bool) -> float:
        """Forward once, backward twice as much; a recomputed block runs forward again."""
        passes = 4 if recompute and self.once.blocks else 3
        return float(self.once.flops * (self.plain + passes * self.trained))


@dataclass(frozen=True, slots=True, kw_only=True)
class StageWork:
    """All that one sample needs."""

    networks: tuple[NetworkWork, ...]
    gaussians: int
    times: int
    images: int


def stage_work(stage: StageRecipe, model: ModelConfig) -> StageWork:
    """The work of one sample of a stage.

    Raises:
        ConfigError: a kind of stage, or a model, whose operations are not counted.
    """
    if stage.kind not in CALLS:
        raise ConfigError(
            f"forecast: expected a stage of kind {', '.join(CALLS)}, got {stage.kind}; measure a "
            "few steps instead: train --steps 3"
        )
    data, shape = stage.data, SampleShape(frames=stage.data.frames, size_px=stage.data.size_px)
    per_time = 2 if data.views > 1 and data.target_frames > 1 else 1
    times = max(data.target_frames // per_time, 1)
    networks = tuple(
        NetworkWork(
            name=name,
            once=count(name, model, shape),
            plain=plain,
            trained=times if trained == TIMES else trained,
        )
        for name, plain, trained in CALLS[stage.kind]
    )
    renders = stage.kind in RENDERING
    height, width = (side // model.ldrm.grid_stride for side in data.size_px)
    return StageWork(
        networks=networks,
        gaussians=data.frames * height * width if renders else 0,
        times=times,
        images=times * per_time if renders else 0,
    )
