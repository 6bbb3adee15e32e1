"""How good could a scene be? True depth and true colours of the nearest given frame, as Gaussians.

Run ``python benchmarks/bounds.py --items 16 --out FILE.md``: every pixel of the given frame nearest
in time stands at its true depth; where the evaluated camera looks past all of them it sees the best
plane. No network takes part, nothing has to be guessed but what the frame does not show. The rest
is resampling, hidden places and motion between two frames. With ``--task generation`` the first
image is all that is given, and nothing moves.

Axes: ``h w`` pixels.
"""

import argparse
import statistics
from dataclasses import replace
from pathlib import Path

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.evaluation.measures.covisibility import covisible_masks
from diff4splat.evaluation.protocols.datasets import open_clips
from diff4splat.evaluation.protocols.protocol import Pair
from diff4splat.evaluation.protocols.protocol_json import load_protocol
from diff4splat.evaluation.protocols.sample import EvalSample, make_sample
from diff4splat.evaluation.systems.baselines import BEST_PLANE, make_baseline
from diff4splat.evaluation.systems.predictions import Prediction
from diff4splat.geometry.depth import distance_from_depth
from diff4splat.io.atomic import write_text
from diff4splat.metrics.image import psnr
from diff4splat.models.config.networks import ActivationConfig
from diff4splat.models.ldrm.gaussian_head import PixelBase, activate
from diff4splat.models.ldrm.plane_prior import OPAQUE
from diff4splat.render.api import render

SKY_DEPTH = 400.0
"""Where pixels without a depth stand; the median of the first frame is 4."""
ROWS = ("best plane (oracle)", "true depth and colours, plane behind")


def true_picture(
    case: EvalSample, pair: Pair, behind: Float[Tensor, "h w 3"]
) -> Float[Tensor, "h w 3"]:
    """The evaluated camera's view of the nearest given frame at its true depth."""
    frame = case.nearest_input(pair[1])
    cameras = case.input_view.cameras[slice(frame, frame + 1)].to(torch.float32)
    depth = case.input_view.depth[frame].float()
    depth = torch.where(depth > 0, depth, SKY_DEPTH)[None]
    base = PixelBase(
        rgb=case.input_rgb(frame)[None],
        distance=distance_from_depth(cameras, depth),
        opacity=torch.full_like(depth, OPAQUE),
        cameras=cameras,
    )
    gaussians = activate(torch.zeros(12, *depth.shape), base, ActivationConfig())
    seen = render(gaussians, case.camera(pair).to(torch.float32), outputs=("rgb", "alpha"))
    return seen.rgb + (1 - seen.alpha[..., None]) * behind


def main() -> None:
    """Both rows over the items of a protocol."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--protocol", default="held_out_v2")
    parser.add_argument(
        "--task", default="reconstruction", choices=("reconstruction", "generation")
    )
    parser.add_argument("--size", type=int, help="picture side; the protocol's if left out")
    parser.add_argument("--items", type=int, default=16)
    parser.add_argument("--out", type=Path, required=True, help="markdown file")
    options = parser.parse_args()
    loaded = load_protocol(options.protocol)
    if options.size:
        size_px = (options.size, options.size)
        loaded = replace(loaded, protocol=loaded.protocol.at_size(size_px))
    clips, protocol = open_clips(loaded), loaded.protocol
    found: dict[str, list[tuple[float, float]]] = {row: [] for row in ROWS}
    for item in range(options.items):
        clip = clips.clip(protocol.source.first + item)
        case = make_sample(clip, protocol, options.task)
        for row, pictures in both(case, make_baseline(BEST_PLANE, case, protocol.planes)).items():
            found[row].append(pictures)
        print(f"item {item}: { ({row: rows[-1] for row, rows in found.items()}) }", flush=True)
    write_text(options.out, table(found))


def both(case: EvalSample, plane: Prediction) -> dict[str, tuple[float, float]]:
    """Mean PSNR over the evaluated images: whole, and where the input shows something."""
    scores: dict[str, list[tuple[float, float]]] = {row: [] for row in ROWS}
    masks = covisible_masks(case)
    for pair, mask in zip(case.targets.pairs, masks, strict=True):
        truth = case.true_rgb(pair)
        flat = plane.render(case.camera(pair), case.time_s(pair[1]), pair[1]).rgb.float()
        for row, picture in zip(ROWS, (flat, true_picture(case, pair, flat)), strict=True):
            scores[row].append(scored(picture.clamp(0, 1), truth, mask))
    return {
        row: tuple(map(statistics.fmean, zip(*rows, strict=True))) for row, rows in scores.items()
    }


def scored(
    picture: Float[Tensor, "h w 3"], truth: Float[Tensor, "h w 3"], mask: Tensor
) -> tuple[float, float]:
    """PSNR of the image, and of its masked pixels."""
    return float(psnr(picture, truth)), float(psnr(picture[mask][None], truth[mask][None]))


def table(found: dict[str, list[tuple[float, float]]]) -> str:
    """Means over items."""
    lines = ["| | PSNR [dB] | PSNR seen [dB] |", "|---|---:|---:|"]
    for row, scores in found.items():
        whole, seen = map(statistics.fmean, zip(*scores, strict=True))
        lines.append(f"| {row} | {whole:.2f} | {seen:.2f} |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    main()
