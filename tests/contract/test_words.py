"""Public names and help texts are in the field's words; docs/glossary.md says which."""

import ast
import re
from collections.abc import Iterable, Iterator
from itertools import pairwise
from pathlib import Path

import pytest
import tyro

from diff4splat.cli.common.parser import Command

ROOT = Path(__file__).parents[2]
PACKAGES = ("diff4splat", "models", "training", "data_prep", "configs")
OLD_WORDS = re.compile(
    r"(un)?told|tells?|says|unsaid|wholes?|things?|stands|standing|goes|sights?|looks|drafts?|behind"
    r"|judg(es?|ed|ing)|ways?|pictur(es?|ed)|movers?|seen|shown|still(ness)?|usable|refusals?"
    r"|omissions?|finer|answers?|own|found|made|kept_back|left_out"
)
"""Match one word of a name, or two that are joined by ``_``."""
STORED = {
    "found_at": "key of clips",
    "found_pixel_px": "row of the table of `prepare check`",
    "found_depth": "row of the table of `prepare check`",
    "found_flow_px": "row of the table of `prepare check`",
    "found_visible": "row of the table of `prepare check`",
    "judge_every": "key of a fit's settings",
    "picture_memory_mb": "key of a fit's settings",
    "shown_samples": "key of a fit's settings",
    "still": "flag of `generate`; key of generation settings",
    "still_px": "key of protocols",
    "still_share": "flag of `prepare synth`; key of protocols and recipes",
    "stillness": "key of a fit's settings",
}
"""Names that files or the command line hold, and where."""
GEOMETRY = {
    "BEHIND": "farther along the ray than a surface",
    "push_behind_surface": "farther along the ray than a surface",
}
COMMANDS = (
    *("generate", "reconstruct", "fit", "render", "bake", "convert", "inspect", "train", "pack"),
    *("eval", "doctor"),
    *("paths preview", "paths list", "prepare synth", "prepare latents", "prepare check"),
    *("prepare import", "prepare doctor"),
    *("prepare align", "prepare captions", "prepare curate", "prepare poses"),
    *("prepare panoramas", "prepare cutouts", "prepare meshes", "prepare mesh-cutouts"),
    "prepare pipeline",
    *("report error-time", "report knobs", "report stability"),
    *("models list", "models get"),
)


def source_files(package: str) -> list[Path]:
    """Python files of a package; diff4splat holds links to the other packages."""
    links = [ROOT / "diff4splat" / name for name in PACKAGES]
    files = (ROOT / package).rglob("*.py")
    return sorted(file for file in files if not any(link in file.parents for link in links))


def old_words(words: list[str]) -> list[str]:
    """Those of ``words``, and of their neighbours joined by ``_``, that have another word now."""
    return [word for word in (*words, *map("_".join, pairwise(words))) if OLD_WORDS.fullmatch(word)]


def words_of(name: str) -> list[str]:
    """Words of a snake_case or CamelCase name, in lower case."""
    return [part.lower() for part in re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+", name)]


def parameters(function: ast.FunctionDef | ast.AsyncFunctionDef) -> Iterator[str]:
    given = function.args
    every = (*given.posonlyargs, *given.args, *given.kwonlyargs, given.vararg, given.kwarg)
    return (one.arg for one in every if one is not None)


def public_names(body: Iterable[ast.stmt]) -> Iterator[str]:
    """Constants, fields, functions with their parameters, and classes with all of these."""
    for node in body:
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            if not node.name.startswith("_"):
                yield from (node.name, *parameters(node))
        elif isinstance(node, ast.ClassDef):
            if not node.name.startswith("_"):
                yield from (node.name, *public_names(node.body))
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            names = [target.id for target in targets if isinstance(target, ast.Name)]
            yield from (name for name in names if not name.startswith("_"))


@pytest.mark.parametrize("package", PACKAGES)
def test_public_names(package: str) -> None:
    wrong = []
    for file in source_files(package):
        names = {file.stem, file.parent.name, *public_names(ast.parse(file.read_text()).body)}
        allowed = {*STORED, *GEOMETRY}
        wrong += [
            f"{file.relative_to(ROOT)}: {name}"
            for name in sorted(names - allowed)
            if old_words(words_of(name))
        ]
    assert not wrong


def test_every_exception_is_needed() -> None:
    files = [file for package in PACKAGES for file in source_files(package)]
    names = {name for file in files for name in public_names(ast.parse(file.read_text()).body)}
    assert {*STORED, *GEOMETRY} <= names


@pytest.mark.parametrize("command", COMMANDS)
def test_help(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        tyro.cli(Command, prog="diff4splat", args=[*command.split(), "--help"])
    text = re.sub(r"--[\w.-]+", "", capsys.readouterr().out)
    assert not old_words(re.findall(r"[a-z]+", text.lower()))
