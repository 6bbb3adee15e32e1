"""Clips per second and core: our shards, the webdataset package on the same tars, loose files.

    .venv/bin/python benchmarks/clip_reading.py --clips 4 --out out/clip-reading

Every reader returns the same: RGB, depth, cameras and tracks of all frames. Loose files are one PNG
and one OpenEXR per frame, as data sets ship them. One process, one thread, files in the page cache.
"""

import argparse
import io
import json
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import cv2
import numpy as np
import OpenEXR
import torch
import webdataset

from diff4splat.data.clip import Clip
from diff4splat.data.clip_folder import ClipFolder
from diff4splat.data.clip_part import ClipPart
from diff4splat.data.codecs.decode import decode_clip
from diff4splat.data.codecs.encode import Coding
from diff4splat.data.entry import entry_from_json
from diff4splat.data.shard_writer import ShardOptions, ShardWriter
from diff4splat.data_prep.synthetic.renderer.clips import draw_clip
from diff4splat.data_prep.synthetic.renderer.settings import DrawSettings
from diff4splat.data_prep.synthetic.worlds import WorldRecipe, make_world

CODINGS = {
    "PNG, PXR24": Coding(),
    "PNG, half": Coding(depth="half"),
    "MP4, half": Coding(images="mp4", depth="half"),
    "JPEG, half plain": Coding(images="jpeg", depth="half_plain"),
}
WHOLE = ClipPart(flow=False, instances=False, masks=False)
Reader = Callable[[], Iterator[object]]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--clips", type=int, default=4)
    parser.add_argument("--frames", type=int, default=81)
    parser.add_argument("--size", type=int, default=256)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--out", type=Path, default=Path("out/clip-reading"))
    options = parser.parse_args()
    torch.set_num_threads(1)
    cv2.setNumThreads(1)
    prepare(options)
    print(f"{options.clips} clips of {options.frames} frames, {options.size} px, 1024 tracks\n")
    print("| reader | clips per second | MiB per clip |\n|---|---|---|")
    for name, (reader, folder) in readers(options.out).items():
        rate = max(measure(reader) for _ in range(options.rounds))
        size = sum(f.stat().st_size for f in folder.rglob("*") if f.is_file()) / options.clips
        print(f"| {name} | {rate:.1f} | {size / 2**20:.1f} |", flush=True)


def prepare(options: argparse.Namespace) -> None:
    """Draw the clips once, and write them in every form."""
    if (options.out / "loose").exists():
        return
    size = (options.size, options.size)
    recipe = WorldRecipe(seed=1, frames=options.frames, size_px=size, views=1, still_share=0)
    for index in range(options.clips):
        clip = draw_clip(make_world(recipe, index), DrawSettings(tracks=1024, flow=False))
        for name, coding in CODINGS.items():
            writing = ShardOptions(generator="benchmark", coding=coding)
            with ShardWriter(options.out / folder_name(name), writing, index > 0) as writer:
                writer.write(clip)
        write_loose(clip, options.out / "loose" / f"{index:03d}")


def folder_name(coding: str) -> str:
    return coding.lower().replace(", ", "-").replace(" ", "-")


def readers(out: Path) -> dict[str, tuple[Reader, Path]]:
    found: dict[str, tuple[Reader, Path]] = {}
    for coding in CODINGS:
        folder = out / folder_name(coding)
        found[f"shards, {coding}"] = (lambda f=folder: shards(f, True, WHOLE), folder)
        found[f"shards, {coding}, without checks"] = (
            lambda f=folder: shards(f, False, WHOLE),
            folder,
        )
        found[f"webdataset, {coding}"] = (lambda f=folder: through_webdataset(f), folder)
    few = ClipPart(frames=tuple(range(0, 81, 9)), flow=False, instances=False, masks=False)
    folder = out / folder_name("PNG, PXR24")
    found["shards, PNG, PXR24, 9 of 81 frames"] = (lambda: shards(folder, True, few), folder)
    found["loose files"] = (lambda: loose(out / "loose"), out / "loose")
    return found


def measure(reader: Reader) -> float:
    """Clips per second of one core: processor time, which other programs do not change."""
    start, count = time.process_time(), 0
    for _ in reader():
        count += 1
    return count / (time.process_time() - start)


def shards(folder: Path, verify: bool, part: ClipPart) -> Iterator[Clip]:
    clips = ClipFolder(folder, verify)
    for place in range(len(clips)):
        yield clips.clip(place, part)


def through_webdataset(folder: Path) -> Iterator[Clip]:
    """The package finds the members; the decoders are ours."""
    files = [str(file) for file in sorted(folder.glob("*.tar"))]
    for sample in webdataset.WebDataset(files, shardshuffle=False, empty_check=False):
        members = {
            name: content
            for name, content in sample.items()
            if isinstance(content, bytes) and not name.startswith(("flow", "instances"))
        }
        entry = entry_from_json(json.loads(members["meta.json"]))
        yield decode_clip(members, entry, WHOLE)


def write_loose(clip: Clip, folder: Path) -> None:
    folder.mkdir(parents=True)
    view = clip.views[0]
    for frame in range(clip.frames):
        cv2.imwrite(str(folder / f"rgb_{frame:04d}.png"), view.rgb[frame].numpy()[..., ::-1])
        header = {"compression": OpenEXR.PXR24_COMPRESSION, "type": OpenEXR.scanlineimage}
        with OpenEXR.File(header, {"Z": view.depth[frame].numpy()}) as opened:
            opened.write(str(folder / f"depth_{frame:04d}.exr"))
    camera = view.cameras
    np.savez(
        folder / "clip.npz",
        focal_px=camera.focal_px,
        center_px=camera.center_px,
        world_from_camera=camera.world_from_camera,
        positions=clip.tracks.positions,
        uv=view.track_uv,
        visible=view.track_visible,
    )


def loose(folder: Path) -> Iterator[dict[str, np.ndarray]]:
    for clip in sorted(folder.iterdir()):
        images = [cv2.imread(str(f))[..., ::-1] for f in sorted(clip.glob("rgb_*.png"))]
        depths = []
        for file in sorted(clip.glob("depth_*.exr")):
            with OpenEXR.File(io.BytesIO(file.read_bytes()), separate_channels=True) as opened:
                depths.append(opened.parts[0].channels["Z"].pixels)
        with np.load(clip / "clip.npz") as stored:
            arrays = {name: stored[name] for name in stored}
        yield {**arrays, "rgb": np.stack(images), "depth": np.stack(depths)}


if __name__ == "__main__":
    main()
