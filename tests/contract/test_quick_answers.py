"""Wrong arguments are answered before torch, Numba or Kornia is loaded; so is the version."""

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Annotated, Any, get_args, get_origin, get_type_hints

import pytest
from PIL import Image

from diff4splat.cli.common.parser import Command
from diff4splat.cli.options.constraints import Constraint
from diff4splat.cli.options.optics import OpticsOptions

ROOT = Path(__file__).parents[2]
HEAVY = ("torch", "numba", "kornia", "cv2", "scipy")
WRONG = """
generate nowhere.png
generate pipe.png
generate folder
generate photo.png --out photo.png
generate photo.png --out photo.png/below
generate photo.png --camera spiarl
generate photo.png --camera forward --amplitude 5
generate photo.png --camera gone.txt
generate photo.png --model enormous
generate photo.png --steps 0
generate photo.png --frames 0
generate photo.png --fov nan
generate photo.png --seed -1
generate grey.png
reconstruct nowhere
reconstruct folder --frames 4
reconstruct folder --resolution 0
reconstruct folder --median-depth -1
reconstruct folder --model enormous
fit nowhere
fit pipe.png
fit folder --init nowhere
fit folder --minutes 0
render nowhere
render scene --out view.avi
render scene --resolution 0
render scene --lens opencv --f-stop -1
render scene --amplitude 1
render scene --easing linear
render scene --dataset --out view.png
bake nowhere --out baked
bake scene --out scene
bake scene --out /dev/null
bake scene --out baked --keys 0
convert nowhere --out folder
convert scene --out folder --fps 0
convert scene --out other.safetensors --time 1
paths preview nowhere
paths preview spiral --out path.gif
inspect
inspect nowhere
inspect --config enormous
inspect --model enormous
report error-time --repeats 0
report stability --only nothing
report stability --model enormous
report stability --out photo.png
prepare synth --out folder --clips 0
prepare latents --clips nowhere --out folder
prepare latents --clips folder --out folder --config enormous
prepare check --folder nowhere
prepare import nowhere --dataset spring --out folder
prepare import folder --dataset spring --out folder --frames 1
prepare doctor nowhere --dataset spring
prepare doctor folder --dataset spring --out folder
prepare align nowhere --out folder --reference tracks
prepare align folder --out folder --reference megasam
prepare curate nowhere --out folder
prepare panoramas nowhere.exr --out folder
prepare cutouts nowhere --photographs folder --out folder --license MIT
prepare meshes nowhere --out meshes.safetensors --license MIT
prepare mesh-cutouts nowhere.safetensors --out folder
prepare poses nowhere.mp4 --out poses.json
prepare captions folder --out folder
prepare pipeline nowhere.toml
train --config nowhere --stage vae
train --config small --stage nowhere
train --config small --stage vae --clips nowhere
train --config small --stage vae --set vae=1
train --config small --stage vae --minutes 0
pack nowhere --out folder
eval --protocol nowhere
eval --model enormous
eval --features vgg:nowhere
eval --items 0
"""
CHILD = """
import json, sys
from diff4splat.cli.main import run

for line in json.loads(sys.argv[1]):
    code = run(line.split())
    print(json.dumps([line, code, sorted(set(sys.modules) & set(json.loads(sys.argv[2])))]))
"""
FREE = {
    ("Generate", "images"): "their headers are read",
    ("Render", "frame"): "depends on the scene",
    ("Render", "out"): "depends on --dataset",
    ("Convert", "out"): "depends on its ending",
    ("Convert", "target"): "depends on its ending",
    ("Pack", "model"): "has a message of its own",
}
"""(command, option) without a constraint of its own."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("inputs")
    Image.new("RGB", (32, 32)).save(folder / "photo.png")
    Image.new("L", (32, 32)).save(folder / "grey.png")
    (folder / "scene").write_text("not read")
    (folder / "folder").mkdir()
    os.mkfifo(folder / "pipe.png")
    return folder


def in_child(lines: list[str], folder: Path) -> list[tuple[str, int, list[str]]]:
    """(arguments, exit code, heavy modules) of each line, in one process."""
    done = subprocess.run(
        [sys.executable, "-c", CHILD, json.dumps(lines), json.dumps(HEAVY)],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=True,
    )
    return [tuple(json.loads(line)) for line in done.stdout.splitlines() if line.startswith("[")]


def test_wrong_arguments_need_no_large_library(folder: Path) -> None:
    before = sorted(folder.iterdir())
    lines = WRONG.strip().splitlines()
    assert in_child(lines, folder) == [(line, 2, []) for line in lines]
    assert sorted(folder.iterdir()) == before


def test_the_version_needs_no_large_library(folder: Path) -> None:
    assert in_child(["--version"], folder) == [("--version", 0, [])]


def dataclasses_in(annotation: Any) -> Iterator[type]:
    """Every command in a union, however nested."""
    if isinstance(annotation, type) and is_dataclass(annotation):
        yield annotation
    for argument in get_args(annotation):
        yield from dataclasses_in(argument)


def unconstrained(command: type) -> Iterator[tuple[str, str]]:
    """Numbers and paths that nothing is said about."""
    hints = get_type_hints(command, include_extras=True)
    for field in fields(command):
        hint = hints[field.name]
        bare, *marks = get_args(hint) if get_origin(hint) is Annotated else (hint,)
        if is_dataclass(bare):
            yield from unconstrained(bare)
        elif any(isinstance(mark, Constraint) for mark in marks):
            continue
        elif {int, float, Path} & {bare, *get_args(bare)}:
            yield command.__name__, field.name


def test_every_number_and_path_of_every_command_has_a_constraint() -> None:
    found = {pair for command in dataclasses_in(Command) for pair in unconstrained(command)}
    # Optics have checks of their own, which need several options at once.
    assert {pair for pair in found if pair[0] != OpticsOptions.__name__} == set(FREE)
