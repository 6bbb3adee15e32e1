"""Core-seconds per clip and stage of preparation, and what a whole collection takes.

    python -m benchmarks.curation_cost --out out/curation-cost

Processor time of one thread, which other programs on the machine hardly change. A procedural clip
of ``--frames`` frames is measured; every stage is linear in frames, so the table is for 81 of them.
"""

import argparse
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import torch

from diff4splat.data.clip import Clip
from diff4splat.data.clip_folder import ClipFolder
from diff4splat.data.codecs.encode import encode_clip
from diff4splat.data.shard_writer import ShardOptions, ShardWriter
from diff4splat.data_prep.alignment.align_clip import AlignmentSettings, align_clip
from diff4splat.data_prep.alignment.opencv.flow_disparity import flow_disparity
from diff4splat.data_prep.alignment.references.reference import Reference
from diff4splat.data_prep.curation.clip_record import record_of
from diff4splat.data_prep.curation.completion import completed
from diff4splat.data_prep.curation.scoring import STAGES
from diff4splat.data_prep.curation.working_clip import working_clip
from diff4splat.data_prep.synthetic.renderer.clips import draw_clip
from diff4splat.data_prep.synthetic.renderer.settings import DrawSettings
from diff4splat.data_prep.synthetic.worlds import WorldRecipe, make_world

COLLECTION, FRAMES = 130_000, 81
MACHINES = ((1, 2), (1, 16), (1, 64), (8, 64))
"""(machines, cores of each)"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=9)
    parser.add_argument("--height", type=int, default=288)
    parser.add_argument("--width", type=int, default=512)
    parser.add_argument("--out", type=Path, default=Path("out/curation-cost"))
    options = parser.parse_args()
    torch.set_num_threads(1)
    cv2.setNumThreads(1)
    clip = drawn(options)
    print_tables(measured(clip, options.out / "clips"), clip)


def drawn(options: argparse.Namespace) -> Clip:
    size = (options.height, options.width)
    recipe = WorldRecipe(seed=1, frames=options.frames, size_px=size, views=1, still_share=0)
    return draw_clip(make_world(recipe, 0), DrawSettings(tracks=1024, threads=1))


def measured(clip: Clip, folder: Path) -> dict[str, float]:
    """Seconds of each stage, in the order in which a clip meets them."""
    seconds = {"encode and write": timed(lambda: write(clip, folder))}
    shards = ClipFolder(folder)
    seconds["read"] = timed(lambda: shards.clip(0))
    seconds["align: disparity by flow"] = timed(lambda: flow_disparity(clip.views[0]))
    seconds["align: fit"] = timed(lambda: aligned(clip))
    seconds["captions, selection: copy"] = timed(lambda: shards.encoded(0))
    working = working_clip(clip, record_of(clip, "clips", ""))
    for name, stage in STAGES.items():
        start = time.process_time()
        working = stage(working)
        seconds[f"score: {name}"] = time.process_time() - start
    seconds["complete: masks, tracks"] = timed(lambda: completed(without_masks(clip)))
    return seconds


def timed(work: Callable[[], object]) -> float:
    """Processor seconds of the second of two runs: the first loads and compiles."""
    for _ in range(2):
        start = time.process_time()
        work()
        seconds = time.process_time() - start
    return seconds


def write(clip: Clip, folder: Path) -> None:
    with ShardWriter(folder, ShardOptions(generator="benchmark"), append=True) as writer:
        if not writer.identifiers:
            writer.write(clip)
        else:
            encode_clip(clip)


def aligned(clip: Clip) -> None:
    depth = clip.views[0].depth.numpy()
    disparity = 1 / depth.clip(0.1, None) * (depth > 0)
    align_clip(
        clip, disparity, Reference(depth=depth, name="depth", metric="aligned"), AlignmentSettings()
    )


def without_masks(clip: Clip) -> Clip:
    views = [replace(v, instances=None, track_uv=None, track_visible=None) for v in clip.views]
    return replace(clip, views=tuple(views), tracks=None)


def print_tables(seconds: dict[str, float], clip: Clip) -> None:
    factor = FRAMES / clip.frames
    total = factor * sum(seconds.values())
    height, width = clip.size_px
    print(f"Clips of {FRAMES} frames, {width} × {height} px, measured on {clip.frames} frames.\n")
    print(f"| stage | core-seconds per clip | core-hours for {COLLECTION:,} clips |\n|---|---|---|")
    for name, value in (*seconds.items(), ("all", total / factor)):
        print(f"| {name} | {value * factor:.2f} | {value * factor * COLLECTION / 3600:,.0f} |")
    print("\n| machines | cores each | days |\n|---|---|---|")
    for machines, cores in MACHINES:
        print(f"| {machines} | {cores} | {total * COLLECTION / machines / cores / 86400:.1f} |")


if __name__ == "__main__":
    main()
