"""Whole scenes of the eight inputs, from other cameras and at other times.

Axes: ``h w`` pixels. Errors are means over inputs and over three views along the camera path:

    image     RMSE of RGB in [0, 1], and the PSNR
    depth     |z - z'| / z'
    motion    distance of the rendered flow from the first to the last time, pixels
"""

from dataclasses import dataclass

import torch
from torch import Tensor

from diff4splat.error_time.subjects.errors import mean_psnr_db, relative_depth
from diff4splat.error_time.subjects.inputs import Inputs, image_input
from diff4splat.error_time.subjects.model import shipped_model
from diff4splat.generation.pipeline import Diff4SplatPipeline
from diff4splat.generation.settings import GenerationSettings
from diff4splat.models.hub.model import Model
from diff4splat.render.api import render
from diff4splat.render.settings import RenderSettings
from diff4splat.scene.scene import Scene

Scenes = list[Scene]

SHARES = (0.0, 0.3, 0.8)
"""Along the path and in time."""
KEPT = 32
"""Scenes whose views are kept: those of a reference and of the setting that is compared."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Views:
    """What a scene looks like."""

    rgb: Tensor
    depth: Tensor
    flow_px: Tensor


_seen: dict[int, tuple[Scene, Views]] = {}


def run(settings: GenerationSettings, inputs: Inputs) -> Scenes:
    """The scene of each input."""
    return generate(shipped_model(), settings, inputs)


def generate(model: Model, settings: GenerationSettings, inputs: Inputs) -> Scenes:
    """The same by a model that may have other networks."""
    pipeline = Diff4SplatPipeline(model)
    every = [image_input(index) for index in inputs]
    return [pipeline(one.image, one.path, one.prompt, settings=settings) for one in every]


def error(scenes: Scenes, reference: Scenes) -> float:
    """Root mean square difference of all views."""
    pairs = [
        (views(one).rgb, views(other).rgb) for one, other in zip(scenes, reference, strict=True)
    ]
    return float(torch.stack([(a - b).square().mean() for a, b in pairs]).mean().sqrt())


def more_errors(scenes: Scenes, reference: Scenes) -> dict[str, float]:
    """Image, depth and motion."""
    pairs = [(views(one), views(other)) for one, other in zip(scenes, reference, strict=True)]
    depth = [relative_depth(a.depth, b.depth) for a, b in pairs]
    flow = [float((a.flow_px - b.flow_px).norm(dim=-1).mean()) for a, b in pairs]
    return {
        "image [dB]": mean_psnr_db([a.rgb for a, _ in pairs], [b.rgb for _, b in pairs]),
        "depth [rel.]": sum(depth) / len(depth),
        "motion [px]": sum(flow) / len(flow),
    }


def views(scene: Scene) -> Views:
    """Colour, depth and flow of a scene along its path.

    Those of the last scenes are kept: every setting is compared with the same reference, twice.
    """
    known = _seen.pop(id(scene), None)
    if known is None or known[0] is not scene:
        known = (scene, _rendered(scene))
    _seen[id(scene)] = known
    while len(_seen) > KEPT:
        del _seen[next(iter(_seen))]
    return known[1]


@torch.no_grad()
def _rendered(scene: Scene) -> Views:
    count, times = len(scene.path), scene.path.times_s
    settings = RenderSettings(flow_time_s=float(times[-1]))
    outputs = []
    for share in SHARES:
        index = round(share * (count - 1))
        outputs.append(
            render(
                scene,
                scene.path.cameras[index],
                float(times[index]),
                outputs=("rgb", "depth", "flow"),
                settings=settings,
            )
        )
    return Views(
        rgb=torch.stack([one.rgb for one in outputs]),
        depth=torch.stack([one.depth for one in outputs]),
        flow_px=torch.stack([one.flow for one in outputs]),
    )
