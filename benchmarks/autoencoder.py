"""What images lose in the autoencoder: held-out clips and photographs, to latents and back.

Run ``python benchmarks/autoencoder.py --clips 16 --out FILE.md``; prints Markdown. Clips are the
first ones of ``held_out_v2``, every second frame, at the model's own size and at twice that; a
photograph of scikit-image is shown as a video that stands still.
"""

import argparse
import statistics
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.evaluation.protocols.datasets import open_clips
from diff4splat.evaluation.protocols.protocol_json import load_protocol
from diff4splat.generation.inputs.input_image import choose_focal, prepare_image
from diff4splat.io.atomic import write_text
from diff4splat.io.pixels import unit_rgb
from diff4splat.metrics.image import psnr
from diff4splat.models.hub.model import Model, load_model

PROTOCOL = "held_out_v2"
PHOTOGRAPHS = ("astronaut", "coffee", "chelsea", "rocket")


@torch.no_grad()
def coded_psnr(model: Model, video: Float[Tensor, "f h w 3"]) -> float:
    """Mean over frames, in dB."""
    autoencoder = model.networks.vae
    latent = autoencoder.encode(video.movedim(-1, 0)[None] * 2 - 1).mean
    decoded = (autoencoder.decode(latent)[0].movedim(0, -1) + 1) / 2
    return float(psnr(decoded.clamp(0, 1), video).mean())


def clip_videos(side: int, count: int) -> Iterator[Float[Tensor, "f h w 3"]]:
    """What reconstruction is given of held-out clips."""
    loaded = load_protocol(PROTOCOL)
    loaded = replace(loaded, protocol=loaded.protocol.at_size((side, side)))
    clips = open_clips(loaded)
    for item in range(count):
        shown = clips.clip(item).views[0].rgb[:: loaded.protocol.input_stride]
        yield unit_rgb(shown)


def photograph(name: str, side: int, frames: int) -> Float[Tensor, "f h w 3"]:
    """A photograph of scikit-image, cut and resized as ``generate`` does."""
    import skimage.data

    rgb = torch.from_numpy(getattr(skimage.data, name)()).float() / 255
    focal = choose_focal((rgb.shape[0], rgb.shape[1]), None, None)
    return prepare_image(rgb, focal, side).rgb.expand(frames, -1, -1, -1)


def table(model: Model, clips: int) -> str:
    """One row per size."""
    side = model.config.size_px[0]
    titles = ["size", f"{clips} clips", "worst clip", *PHOTOGRAPHS]
    lines = [f"| {' | '.join(titles)} |", f"| ---: {'| ---: ' * (len(titles) - 1)}|"]
    for size in (side, 2 * side):
        found = [coded_psnr(model, video) for video in clip_videos(size, clips)]
        shown = [photograph(name, size, model.config.frames) for name in PHOTOGRAPHS]
        numbers = [statistics.fmean(found), min(found), *(coded_psnr(model, p) for p in shown)]
        lines.append(f"| {size} px | {' | '.join(f'{number:.1f}' for number in numbers)} |")
    return "\n".join(lines) + "\n"


def main() -> None:
    """The table of a model."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--model", default="small")
    parser.add_argument("--clips", type=int, default=16)
    parser.add_argument("--out", type=Path, help="markdown file")
    options = parser.parse_args()
    found = table(load_model(options.model), options.clips)
    print(found)
    if options.out:
        write_text(options.out, found)


if __name__ == "__main__":
    main()
