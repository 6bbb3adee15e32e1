"""A thousand frames from the video decoder: does the error grow with the frames?

Axes: ``c t h w`` latents, ``f`` frames. The decoder runs latent frame by latent frame, each with
the caches of the one before; the exact video comes from float64 in long chunks.
"""

import copy
from collections.abc import Iterator
from functools import cache, partial
from itertools import pairwise

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.models.config.networks import TIME_STRIDE
from diff4splat.stability.check import Check, Outcome
from diff4splat.stability.checks.network_checks import model_of
from diff4splat.stability.compare import all_finite, relative_error, rms_error
from diff4splat.stability.plots import Curves
from diff4splat.stability.subjects.casting import DTYPES, CastNetwork

GROUP = "long-videos"
LATENT_FRAMES, CELLS = 251, 2
EXACT_CHUNK = 50
PART_FRAMES = 40
"""Frames whose mean is one point of a curve."""
LIMITS = {"float32": 1e-4, "bfloat16": 0.1, "float16": 0.02}
CASES = (*(("changing", dtype) for dtype in LIMITS), ("constant", "float32"))
MAX_GROWTH = 2.0
"""More would be drift."""


def vae_checks(model: str) -> Iterator[Check]:
    """Random and constant latents, and chunks of several latent frames."""
    for content, dtype in CASES:
        yield Check(
            group=GROUP,
            name=f"{content} latents, decoder in {dtype}",
            run=partial(measure_decoder, model, content, dtype),
            limit=LIMITS[dtype],
            error_unit="largest difference over largest value",
        )
        yield Check(
            group=GROUP,
            name=f"{content} latents, drift of the decoder in {dtype}",
            run=partial(measure_drift, model, content, dtype),
            limit=MAX_GROWTH,
            error_unit="error of the last tenth of the frames over that of the first",
        )
    yield Check(
        group=GROUP,
        name="chunks of seven latent frames against single ones, float64",
        run=partial(measure_chunks, model),
        limit=1e-10,
        error_unit="largest difference over largest value",
        quick=True,
    )


@torch.no_grad()
def measure_decoder(model: str, content: str, dtype: str) -> Outcome:
    """Errors over time."""
    got, errors = _decoded(model, content, dtype), _errors(model, content, dtype)
    x = tuple(float(PART_FRAMES * index) for index in range(len(errors)))
    return Outcome(
        error=relative_error(got, _exact(model, content)),
        value_finite=all_finite([got]),
        plots=(
            Curves(
                title=f"decoder in {dtype}, {content} latents",
                x_label="frame",
                x=x,
                y_label="RMS error",
                lines=(("RMS error", tuple(errors)),),
            ),
        ),
    )


def measure_drift(model: str, content: str, dtype: str) -> Outcome:
    """Whether late frames are worse than early ones."""
    errors = _errors(model, content, dtype)
    tenth = max(len(errors) // 10, 1)
    early, late = sum(errors[:tenth]), sum(errors[-tenth:])
    return Outcome(error=late / early if early > 0 else float(late > 0))


@torch.no_grad()
def measure_chunks(model: str) -> Outcome:
    """The size of the chunks must not matter."""
    vae, some = float64_vae(model), latents(model, "changing")[:, :, :29]
    return Outcome(error=relative_error(decode(vae, some, 7), decode(vae, some, 1)))


def float64_vae(model: str) -> torch.nn.Module:
    """The autoencoder in float64."""
    return copy.deepcopy(model_of(model).networks.vae).double()


def decode(
    vae: CastNetwork | torch.nn.Module, latent: Float[Tensor, "b c t h w"], chunk: int
) -> Float[Tensor, "b 3 f hh ww"]:
    """Video in chunks of ``chunk`` latent frames, without the frames before the first."""
    caches, frames = vae.initial_caches(latent[:, :, :1]), []
    for start in range(0, latent.shape[2], chunk):
        part, caches = vae.decode_chunk(latent[:, :, start : start + chunk], caches)
        frames.append(part.double())
    return torch.cat(frames, 2)[:, :, TIME_STRIDE - 1 :]


def latents(model: str, content: str) -> Float[Tensor, "b c t h w"]:
    """Standard normal latents, new in every frame or the same in all."""
    channels = model_of(model).config.vae.latent_channels
    generator = torch.Generator().manual_seed(5)
    frames = LATENT_FRAMES if content == "changing" else 1
    shape = (1, channels, frames, CELLS, CELLS)
    drawn = torch.randn(shape, generator=generator, dtype=torch.float64)
    return drawn.expand(-1, -1, LATENT_FRAMES, -1, -1).float().double()


@cache
@torch.no_grad()
def _decoded(model: str, content: str, dtype: str) -> Float[Tensor, "b 3 f hh ww"]:
    """Latent frame by latent frame."""
    vae = CastNetwork(model_of(model).networks.vae, DTYPES[dtype])
    return decode(vae, latents(model, content).float(), 1)


def _errors(model: str, content: str, dtype: str) -> list[float]:
    """RMS error of every part of the video."""
    got, exact = _decoded(model, content, dtype), _exact(model, content)
    return [
        rms_error(got[:, :, start:stop], exact[:, :, start:stop])
        for start, stop in pairwise(range(0, exact.shape[2] + 1, PART_FRAMES))
    ]


@cache
@torch.no_grad()
def _exact(model: str, content: str) -> Float[Tensor, "b 3 f hh ww"]:
    return decode(float64_vae(model), latents(model, content), EXACT_CHUNK)
