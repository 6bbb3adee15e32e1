"""ONNX Runtime against PyTorch on whole generations: seconds, bytes and images of both scenes.

    diff4splat export onnx --model small --out out/onnx/small
    python -m benchmarks.onnx_runtime --graphs out/onnx/small --photo picture.jpg --out onnx.md

Every command is a process of its own, the runtimes take turns, and the fastest of each counts.
"""

import argparse
import json
import subprocess
import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path
from shutil import copy

import torch

from diff4splat.io.scene_files.scene_file import load_scene
from diff4splat.metrics.image import psnr
from diff4splat.models.onnx.manifest import file_entry, read_manifest, write_manifest
from diff4splat.models.onnx_export.precision import convert_precision
from diff4splat.render.api import render
from diff4splat.scene.scene import Scene

PRECISIONS = ("float32", "float16", "int8", "int8-dynamic")
PROMPT = "in a meadow, a turquoise rounded block slides to the left"
CASES = {"none": ["--fill", "none"], "video": ["--fill", "video"]}
FIRST_RESULT = {
    "torch": """
from diff4splat.models.hub.model import load_model
import torch
networks = load_model("small", parts=("monocular_depth", "text_encoder", "motion_unet")).networks
with torch.no_grad():
    image, noisy = torch.zeros(1, 3, 64, 64), torch.zeros(1, 3, 2, 16, 16)
    networks.monocular_depth(image)
    text = networks.text_encoder.encode_prompt("it moves")
    networks.motion_unet.predict_motion_and_mask(image, noisy, torch.ones(1), text)
""",
    "onnx": """
import numpy as np
from diff4splat.models.onnx.graph import OnnxModel
graphs = OnnxModel({graphs!r})
image, noisy = np.zeros((1, 3, 64, 64), "f4"), np.zeros((1, 3, 2, 16, 16), "f4")
graphs["monocular_depth"]({{"image": image}})
tokens, mask = np.array([[257, *b"it moves", 258]]), np.ones((1, 10), bool)
text = graphs["text_encoder"]({{"tokens": tokens, "mask": mask}})["states"]
level = np.ones(1, "f4")
graphs["motion_unet"](
    {{"image": image, "noisy": noisy, "level": level, "text": text, "text_mask": mask}})
""",
}
"""From the start of the process to the output of every network of a default generation."""


@dataclass(frozen=True, kw_only=True)
class Generation:
    """One command, repeated."""

    seconds: float
    scene: Scene


def converted(graphs: Path, precision: str) -> Path:
    """The folder in another precision, beside the one in float32."""
    if precision == "float32":
        return graphs
    folder = graphs.with_name(f"{graphs.name}-{precision}")
    folder.mkdir(exist_ok=True)
    manifest = read_manifest(graphs)
    entries = []
    for entry in manifest.graphs:
        file = folder / entry.files[0].name
        copy(graphs / file.name, file)
        convert_precision(file, precision)
        entries.append(replace(entry, files=(file_entry(file),)))
    for file in manifest.files:
        copy(graphs / file.name, folder / file.name)
    write_manifest(replace(manifest, precision=precision, graphs=tuple(entries)), folder)
    return folder


def timed(command: list[str]) -> float:
    start = time.perf_counter()
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    return time.perf_counter() - start


def generations(
    models: dict[str, str], photo: Path, options: list[str], runs: int, folder: Path
) -> dict[str, Generation]:
    seconds: dict[str, list[float]] = {name: [] for name in models}
    for _ in range(runs):
        for name, model in models.items():
            out = folder / name
            command = ["generate", str(photo), "--model", model, "--prompt", PROMPT]
            command += ["--camera", "arc:0.2", "--out", str(out), *options]
            seconds[name].append(timed([sys.executable, "-m", "diff4splat.cli.main", *command]))
    return {
        name: Generation(
            seconds=min(seconds[name]), scene=load_scene(folder / name / "scene.safetensors")
        )
        for name in models
    }


def least_psnr(first: Scene, second: Scene) -> float:
    """Of all frames along the path, in dB."""
    values = []
    for index, time_s in enumerate(first.path.times_s.tolist()):
        images = [
            render(scene.motion.state_at(scene.gaussians, time_s), first.path.cameras[index]).rgb
            for scene in (first, second)
        ]
        values.append(float(psnr(images[0].clamp(0, 1), images[1].clamp(0, 1))))
    return min(values)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--graphs", type=Path, required=True)
    parser.add_argument("--photo", type=Path, required=True)
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--work", type=Path, default=Path("out/onnx_runtime"))
    given = parser.parse_args()
    folders = {precision: converted(given.graphs, precision) for precision in PRECISIONS}
    models = {"torch": "small"} | {name: str(folder) for name, folder in folders.items()}
    lines = ["| fill | runtime | MB | seconds | of PyTorch | least PSNR along the path |"]
    lines += ["|---|---|---:|---:|---:|---:|"]
    for fill, options in CASES.items():
        found = generations(models, given.photo, options, given.runs, given.work / fill)
        for name, row in found.items():
            folder = folders.get(name, Path("models/weights/small"))
            size = sum(f.stat().st_size for f in folder.glob("*.*") if f.suffix != ".md") / 1e6
            quality = (
                "" if name == "torch" else f"{least_psnr(found['torch'].scene, row.scene):.1f} dB"
            )
            share = row.seconds / found["torch"].seconds
            lines.append(
                f"| {fill} | {name} | {size:.1f} | {row.seconds:.2f} | {share:.2f} | {quality} |"
            )
            print(lines[-1], flush=True)
    first = {name: [] for name in FIRST_RESULT}
    for _ in range(given.runs):
        for name, code in FIRST_RESULT.items():
            first[name].append(timed([sys.executable, "-c", code.format(graphs=str(given.graphs))]))
    lines += [
        "",
        f"Start to depth, text and motion: PyTorch {min(first['torch']):.2f} s, ONNX Runtime ",
    ]
    lines[-1] += f"{min(first['onnx']):.2f} s."
    given.out.write_text("\n".join(lines) + "\n")
    print(json.dumps(first), torch.get_num_threads())


if __name__ == "__main__":
    main()
