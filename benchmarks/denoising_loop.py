"""Our denoising loop against the pipelines of diffusers, with equal weights, in one process.

    .venv/bin/python benchmarks/denoising_loop.py --family wan --rounds 5

Both run the same Euler steps with guidance from the same noise, so their latents must agree. Rounds
alternate. Memory is the peak of the process above what it held before the loop. Steps of CogVideoX
must divide 1000: else its scheduler leads each step to another level than the next one starts from.
"""

import argparse
import ctypes
import statistics
import time
from collections.abc import Callable
from pathlib import Path

import torch
from denoising import cogvideox, wan
from denoising.case import CHANNELS, TEXT_WIDTH, Case, our_loop
from torch import Tensor

FAMILIES = {"wan": wan, "cogvideox": cogvideox}
KB = 1024


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--family", choices=FAMILIES, default="wan")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--steps", type=int, default=6)
    parser.add_argument("--width", type=int, default=192)
    parser.add_argument("--side", type=int, default=24, help="latent pixels")
    options = parser.parse_args()
    torch.set_num_threads(1)
    torch.manual_seed(0)
    family = FAMILIES[options.family]
    transformer = family.tiny_transformer(options.width)
    prompt, negative = family.TEXT_TOKENS
    case = Case(
        noise=torch.randn(1, CHANNELS, 5, options.side, options.side),
        text=torch.randn(1, prompt, TEXT_WIDTH),
        negative=torch.randn(1, negative, TEXT_WIDTH),
        steps=options.steps,
    )
    theirs, levels = family.diffusers_loop(transformer, case)
    ours = our_loop(family.our_network(transformer), case, levels)
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
