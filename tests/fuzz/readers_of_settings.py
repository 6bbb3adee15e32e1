"""Recipes, ``--set`` options, evaluation protocols and stored results."""

import json
import shutil
from dataclasses import asdict
from pathlib import Path

from oracles_evaluation import tiny_protocol

from diff4splat.configs.recipes import find_recipe, recipe_by_name
from diff4splat.evaluation.protocols.protocol_json import load_protocol, protocol_json
from diff4splat.evaluation.records import ItemResult, Score, Skip
from diff4splat.evaluation.report.result_store import ItemStore
from diff4splat.fitting.settings import FitSettings
from diff4splat.fitting.settings_json import apply_changes
from diff4splat.training.recipe.fingerprint import fingerprint
from diff4splat.training.recipe.overrides import override
from diff4splat.training.recipe.recipe_json import recipe_to_json
from fuzz.reader import Reader, read_each

GOLDEN = Path(__file__).parents[1] / "golden"
_KEY = "0123456789abcdef"
_OPTIONS = {
    "train": (
        "stages.vae.steps=7",
        'stages.vae.trained=["vae"]',
        "stages.vae.losses.perceptual=0.5",
        "stages.vae.optimizer.betas=[0.9,0.99]",
        "trainer.precision=float32",
        "model.ldrm.width=64",
        "seed=3",
        'seed=3\nstages.vae.steps=5\nstages.vae.trained=["vae"]',
    ),
    "fit": ("density.budget=100", "fine_steps=5", "motion=spacetime", "planes.space=[8,8,8]"),
}


def _write_recipes(folder: Path) -> None:
    (folder / "now.json").write_text(recipe_to_json(recipe_by_name("test")))
    shutil.copy(GOLDEN / "recipe_v1_test.json", folder / "first.json")


def _read_recipes(folder: Path) -> None:
    read_each(folder, _read_recipe)


def _read_recipe(file: Path) -> None:
    recipe = find_recipe(str(file))
    fingerprint(recipe, recipe.stages[0].name)


def _write_options(folder: Path) -> None:
    for name, options in _OPTIONS.items():
        for number, option in enumerate(options):
            (folder / f"{name}-{number}.txt").write_text(option)


def _read_options(folder: Path) -> None:
    """The command line cannot hold zeros or what is no text."""
    read_each(folder, _change)


def _change(file: Path) -> None:
    if not file.is_file() or file.is_symlink():
        return
    lines = file.read_bytes().decode(errors="surrogateescape").replace("\0", "").split("\n")
    if file.stem.startswith("fit"):
        apply_changes(FitSettings(), lines)
    else:
        override(recipe_by_name("test"), lines)


def _write_protocol(folder: Path) -> None:
    (folder / "protocol.json").write_text(protocol_json(tiny_protocol()))


def _read_protocol(folder: Path) -> None:
    protocol = load_protocol(str(folder / "protocol.json")).protocol
    protocol.at_size((32, 32)), protocol.digest, protocol.input_frames("reconstruction")


def _item(number: int) -> ItemResult:
    scores = (Score(row="a", key="psnr", value=20.5, parts=(20.0, None, 21.0)),)
    skips = (Skip(row="a", key="pose", why="no motion"),)
    return ItemResult(item=number, clip="c", clip_sha256="0" * 64, scores=scores, skips=skips)


def _write_results(folder: Path) -> None:
    store = ItemStore(folder / "items.jsonl", _KEY)
    store.add(_item(0))
    store.add(_item(1))


def _read_results(folder: Path) -> None:
    items = ItemStore(folder / "items.jsonl", _KEY).items
    json.dumps([asdict(item) for item in items.values()])


SETTINGS = {
    "recipes": Reader(make=_write_recipes, read=_read_recipes),
    "options": Reader(make=_write_options, read=_read_options),
    "protocol": Reader(make=_write_protocol, read=_read_protocol),
    "results": Reader(make=_write_results, read=_read_results),
}
