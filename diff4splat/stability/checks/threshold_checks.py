"""How many Gaussians change sides when a threshold, or the image, changes a little.

Axes: ``h w`` pixels of the copy of the image that the networks see.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache, partial

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.generation.depth.prediction import SCALES, predict_depth
from diff4splat.generation.inputs.input_image import InputImage
from diff4splat.generation.motion.motion_mask import MotionProbability, motion_probability
from diff4splat.generation.motion.networks import motion_prior
from diff4splat.generation.motion.sampling import MotionRequest
from diff4splat.generation.settings import GenerationSettings
from diff4splat.generation.static_pruning import largest_displacement_px
from diff4splat.render.api import render
from diff4splat.render.settings import RenderSettings
from diff4splat.scene.motion.keyframes import KeyframeMotion
from diff4splat.stability.check import Check, Outcome
from diff4splat.stability.checks.network_checks import model_of
from diff4splat.stability.compare import psnr_db, rms_error
from diff4splat.stability.plots import Curves
from diff4splat.stability.subjects.cloud import camera, cloud
from diff4splat.stability.subjects.drawn_images import objects
from diff4splat.stability.subjects.generated_scenes import PROMPT, as_file, generate

GROUP = "thresholds"
CHANGE = 0.01
"""Relative change of a threshold."""
LIMIT = 0.01
"""Largest share of Gaussians that may change sides."""
CURVE = tuple(1.0 + 0.02 * step for step in range(-10, 11))
"""Factors on a threshold for the curves."""


def threshold_checks(model: str) -> Iterator[Check]:
    """Every threshold of generation and rendering that decides about a Gaussian."""
    runs: dict[str, Callable[[], Outcome]] = {
        f"motion threshold ± {CHANGE:.0%}": partial(measure_motion_threshold, model),
        f"static threshold ± {CHANGE:.0%}": partial(measure_static_threshold, model),
        "motion mask, image ± 1/255": partial(measure_image_noise, model),
        "depth edges, image ± 1/255": partial(measure_depth_edges, model),
    }
    for name, run in runs.items():
        yield Check(
            group=GROUP, name=name, run=run, limit=LIMIT, error_unit="share that changes sides"
        )
    yield Check(
        group=GROUP,
        name=f"cut-off of contributions ± {CHANGE:.0%}",
        run=measure_cutoff,
        limit=1e-3,
        error_unit="RMS of RGB",
        quick=True,
    )


@torch.no_grad()
def measure_motion_threshold(model: str) -> Outcome:
    """The motion mask around its default threshold."""
    sample, default = _motion(model, 0.0), GenerationSettings().motion.threshold
    mask = sample.mask(default)
    shares = [_flipped(sample.mask(default * factor), mask) for factor in CURVE]
    near = [_flipped(sample.mask(default * (1 + sign * CHANGE)), mask) for sign in (-1, 1)]
    return Outcome(
        error=max(near),
        note=f"{_share(mask):.1%} of the pixels move",
        plots=(_curve("motion threshold", shares),),
    )


@torch.no_grad()
def measure_static_threshold(model: str) -> Outcome:
    """Which Gaussians count as static, around the default displacement."""
    settings = replace(GenerationSettings(), static_threshold_px=0.0)
    scene = generate(model_of(model), torch.float32, as_file(objects()), settings).scene
    if not isinstance(scene.motion, KeyframeMotion):
        return Outcome(error=0.0, note="nothing moves")
    moved_px = largest_displacement_px(scene.gaussians, scene.motion, scene.path.cameras[0])
    default = GenerationSettings().static_threshold_px
    total = len(scene.gaussians)

    def flips(factor: float) -> float:
        return float(((moved_px > default) != (moved_px > default * factor)).sum()) / total

    return Outcome(
        error=max(flips(1 - CHANGE), flips(1 + CHANGE)),
        note=f"{int((moved_px > default).sum()):,} of {total:,} Gaussians move",
        plots=(_curve("static threshold", [flips(factor) for factor in CURVE]),),
    )


@torch.no_grad()
def measure_image_noise(model: str) -> Outcome:
    """The motion mask of the image with noise of one step of 8 bits."""
    default = GenerationSettings().motion.threshold
    masks = [_motion(model, noise).mask(default) for noise in (0.0, 1 / 255)]
    return Outcome(error=_flipped(*masks), note=f"{_share(masks[0]):.1%} of the pixels move")


@torch.no_grad()
def measure_depth_edges(model: str) -> Outcome:
    """Pixels at a step of depth of 15 %, which the background layer treats as edges."""
    edges = [_edges(_depth(model, noise)) for noise in (0.0, 1 / 255)]
    return Outcome(error=_flipped(*edges), note=f"{_share(edges[0]):.1%} of the pixels are edges")


@torch.no_grad()
def measure_cutoff() -> Outcome:
    """The image with another cut-off of contributions."""
    default = RenderSettings()
    exact = render(cloud(), camera(), settings=default).rgb
    errors = []
    for sign in (-1, 1):
        settings = replace(default, alpha_cutoff=default.alpha_cutoff * (1 + sign * CHANGE))
        errors.append(rms_error(render(cloud(), camera(), settings=settings).rgb, exact))
    return Outcome(error=max(errors), note=psnr_db(max(errors)))


@cache
def _motion(model: str, noise: float) -> MotionProbability:
    networks = model_of(model).networks
    request = MotionRequest(
        text=networks.text_encoder.encode_prompt(PROMPT), seed=0, settings=GenerationSettings()
    )
    return motion_probability(motion_prior(networks), _noisy(noise), 3, request)


def _depth(model: str, noise: float) -> Float[Tensor, "h w"]:
    config = model_of(model).config.activation
    network = model_of(model).networks.monocular_depth
    return predict_depth(network, _noisy(noise).rgb, config, SCALES[:1]).depth


def _noisy(noise: float) -> InputImage:
    image = as_file(objects())
    generator = torch.Generator().manual_seed(6)
    added = noise * (2 * torch.rand(image.rgb.shape, generator=generator) - 1)
    return replace(image, rgb=(image.rgb + added).clamp(0, 1))


def _edges(depth: Float[Tensor, "h w"]) -> Bool[Tensor, "h w"]:
    log = depth.log()
    step = torch.zeros_like(log)
    step[:, 1:] = log.diff(dim=1).abs()
    step[1:] = torch.maximum(step[1:], log.diff(dim=0).abs())
    return step > 0.15


def _flipped(got: Bool[Tensor, "h w"], want: Bool[Tensor, "h w"]) -> float:
    return _share(got != want)


def _share(mask: Bool[Tensor, "h w"]) -> float:
    return float(mask.double().mean())


def _curve(title: str, shares: list[float]) -> Curves:
    return Curves(
        title=f"{title}: share that changes sides",
        x_label="factor on the threshold",
        x=CURVE,
        y_label="share",
        lines=(("share", tuple(shares)),),
    )
