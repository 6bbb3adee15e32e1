"""Our denoising loop against diffusers' WanPipeline, with equal weights, in one process.

    .venv/bin/python benchmarks/denoising_loop.py --rounds 5

Both run the same Euler steps with guidance from the same noise, so their latents must agree. Rounds
alternate. Memory is the peak of the process above what it held before the loop.
"""

import argparse
import ctypes
import json
import statistics
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import diffusers
import torch
from safetensors.torch import save_file
from torch import Tensor

from diff4splat.flow.guidance import CallCount, Guidance
from diff4splat.flow.samplers import SAMPLERS, integrate
from diff4splat.generation.video.video_sampling import Conditions, video_velocity
from diff4splat.models.config.sizes import paper_size
from diff4splat.models.factory import create_networks
from diff4splat.models.hub.mapped_weights import map_weights
from diff4splat.models.video_dit.conditions import ImageCondition
from diff4splat.models.wan import source_config
from diff4splat.models.wan.key_map import video_dit_key

CHANNELS, TEXT_WIDTH, PROMPT_TOKENS, NEGATIVE_TOKENS = 16, 128, 24, 2
GUIDANCE = 5.0
KB = 1024


@dataclass(frozen=True, kw_only=True)
class Case:
    """What both loops get."""

    noise: Tensor
    text: Tensor
    negative: Tensor
    steps: int


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--steps", type=int, default=6)
    parser.add_argument("--width", type=int, default=192)
    parser.add_argument("--side", type=int, default=24, help="latent pixels")
    options = parser.parse_args()
    torch.set_num_threads(1)
    torch.manual_seed(0)
    transformer = tiny_transformer(options.width)
    case = Case(
        noise=torch.randn(1, CHANNELS, 5, options.side, options.side),
        text=torch.randn(1, PROMPT_TOKENS, TEXT_WIDTH),
        negative=torch.randn(1, NEGATIVE_TOKENS, TEXT_WIDTH),
        steps=options.steps,
    )
    theirs, levels = diffusers_loop(transformer, case)
    ours = our_loop(transformer, case, levels)
    want, got = theirs(), ours()
    print(f"largest difference {float((want - got).abs().max() / want.abs().max()):.1e}")
    report({"diffusers": theirs, "diff4splat": ours}, options)


def report(loops: dict[str, Callable[[], Tensor]], options: argparse.Namespace) -> None:
    """One row per loop: the best and the median of the rounds, the peak."""
    seconds, peaks = {name: [] for name in loops}, {name: [] for name in loops}
    for _ in range(options.rounds):
        for name, loop in loops.items():
            before = reset_peak()
            started = time.perf_counter()
            loop()
            seconds[name].append((time.perf_counter() - started) / options.steps)
            peaks[name].append(memory_kb("VmHWM") - before)
    print(
        "| loop | best ms per step | median ms per step | peak MiB above start |\n|---|---|---|---|"
    )
    for name in loops:
        best, middle = (1000 * f(seconds[name]) for f in (min, statistics.median))
        print(f"| {name} | {best:.1f} | {middle:.1f} | {max(peaks[name]) / KB:.0f} |")
    ratios = [a / b for a, b in zip(seconds["diff4splat"], seconds["diffusers"], strict=True)]
    print(f"ratio of times per round, median: {statistics.median(ratios):.2f}")


def tiny_transformer(width: int) -> torch.nn.Module:
    """Random weights in the layout of T2V-1.3B, an eighth as wide."""
    network = diffusers.WanTransformer3DModel(
        num_attention_heads=width // 32,
        attention_head_dim=32,
        in_channels=CHANNELS,
        out_channels=CHANNELS,
        text_dim=TEXT_WIDTH,
        freq_dim=64,
        ffn_dim=4 * width,
        num_layers=6,
    )
    return network.eval()


def diffusers_loop(
    transformer: torch.nn.Module, case: Case
) -> tuple[Callable[[], Tensor], list[float]]:
    """The pipeline class with its Euler scheduler, and the levels that this one visits."""
    scheduler = diffusers.FlowMatchEulerDiscreteScheduler(shift=3.0)
    vae = diffusers.AutoencoderKLWan(base_dim=8, z_dim=CHANNELS, num_res_blocks=1)
    pipeline = diffusers.WanPipeline(
        tokenizer=None, text_encoder=None, vae=vae, scheduler=scheduler, transformer=transformer
    )
    pipeline.set_progress_bar_config(disable=True)
    frames, side = 4 * (case.noise.shape[2] - 1) + 1, 8 * case.noise.shape[-1]

    def loop() -> Tensor:
        return pipeline(
            prompt_embeds=padded(case.text),
            negative_prompt_embeds=padded(case.negative),
            latents=case.noise.clone(),
            height=side,
            width=side,
            num_frames=frames,
            num_inference_steps=case.steps,
            guidance_scale=GUIDANCE,
            output_type="latent",
        ).frames

    loop()
    return loop, scheduler.sigmas.tolist()


def our_loop(transformer: torch.nn.Module, case: Case, levels: list[float]) -> Callable[[], Tensor]:
    """The same weights, mapped from a file as an imported model's are."""
    dit = our_network(transformer)
    conditions = Conditions(
        image_latent=case.noise[:, :, :1],
        plucker=None,
        text=case.text,
        negative_text=case.negative,
        image=ImageCondition(),
    )

    @torch.no_grad()
    def loop() -> Tensor:
        guidance = Guidance(weight=GUIDANCE)
        velocity = video_velocity(dit, conditions, guidance, CallCount())
        return integrate(SAMPLERS["euler"], velocity, case.noise, levels)

    return loop


def our_network(transformer: torch.nn.Module) -> torch.nn.Module:
    """Ours, with these weights."""
    public = json.loads(json.dumps(dict(transformer.config)))
    settings = replace(source_config.dit_config(public), render_condition=False)
    base = paper_size()
    vae = replace(base.vae, latent_channels=CHANNELS)
    config = replace(base, dit=settings, vae=vae, text=replace(base.text, width=TEXT_WIDTH))
    fresh = create_networks(config, parts=("dit",)).dit.state_dict()
    stored = {video_dit_key(key): value for key, value in transformer.state_dict().items()}
    tensors = {
        key: stored.get(key, value).reshape(value.shape).contiguous()
        for key, value in fresh.items()
    }
    dit = create_networks(config, "meta", parts=("dit",)).dit
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "dit.safetensors"
        save_file(tensors, file)
        map_weights(dit, "dit", file)
    return dit


def padded(text: Tensor) -> Tensor:
    """Zeros up to 512 tokens, as the pipeline pads prompts."""
    return torch.nn.functional.pad(text, (0, 0, 0, 512 - text.shape[1]))


def reset_peak() -> int:
    """The memory that the process holds now, from which on its peak counts; in kB."""
    # What earlier rounds freed must not hide what this one needs.
    ctypes.CDLL("libc.so.6").malloc_trim(0)
    Path("/proc/self/clear_refs").write_text("5")
    return memory_kb("VmRSS")


def memory_kb(name: str) -> int:
    """A line of the process's status."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith(name))


if __name__ == "__main__":
    main()
