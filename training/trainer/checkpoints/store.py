"""Saves and finds checkpoints of a stage; whatever happens, the last good one stays.

Written to a staging folder, described, renamed, and only then named by ``latest``. The checkpoint
folder must be one that all processes see.
"""

import os
import shutil
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from diff4splat import __version__
from diff4splat.errors import CheckpointError, FileFormatError, OutputError
from diff4splat.io.atomic import output_error, write_text
from diff4splat.training.recipe.stage import StageRecipe
from diff4splat.training.trainer.checkpoints.files import (
    LATEST_FILE,
    Checkpoint,
    candidates,
    checkpoint_name,
    digests,
    order,
    read_checkpoint,
    write_state,
)
from diff4splat.training.trainer.checkpoints.tensor_store import write_tensors
from diff4splat.training.trainer.distributed.processes import Processes
from diff4splat.training.trainer.logs.run_files import CHECKPOINTS
from diff4splat.training.trainer.loop.progress import Progress
from diff4splat.training.trainer.settings import RunSettings

MAX_LISTED = 4


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckpointStore:
    """Those of one stage, seen by one process."""

    recipe: StageRecipe
    run: RunSettings
    processes: Processes

    @property
    def folder(self) -> Path:
        """Where they lie."""
        return self.run.folder / CHECKPOINTS

    def save(self, tensors: Mapping[str, Tensor], progress: Progress) -> Path:
        """Write one; all processes call.

        Raises:
            OutputError: it cannot be written; those before it are untouched.
        """
        target = self.folder / checkpoint_name(progress)
        staging = self.folder / f".partial-{target.name}"
        try:
            self.processes.first_does(lambda: _make_empty(staging))
            write_tensors(staging, tensors)
            state = self._describe(progress) | {"files": digests(staging, self.processes)}
            self.processes.first_does(lambda: self._publish(staging, target, state))
        except OutputError as error:
            # People look for the checkpoint, not for the folder it was put together in.
            raise OutputError(str(error).replace(str(staging), str(target))) from error
        except OSError as error:
            raise output_error(target, error) from error
        finally:
            if self.processes.first:
                shutil.rmtree(staging, ignore_errors=True)
        return target

    def find(self, calm: bool = False) -> Checkpoint | None:
        """The newest whole one; with ``calm``, the newest that was not amid spikes.

        Raises:
            CheckpointError: it belongs to another stage or configuration.
        """
        for name in self.processes.first_does(lambda: candidates(self.folder)):
            try:
                found = read_checkpoint(self.folder / name, self.processes)
            except FileFormatError as error:
                if self.processes.first:
                    self.run.note(f"{error}; the checkpoint before it is taken")
                continue
            self._require_same(found)
            if not (calm and found.progress.spikes_in_a_row):
                return found
        return None

    def _require_same(self, found: Checkpoint) -> None:
        accepted = (self.run.fingerprint, self.run.earlier_fingerprint)
        if found.stage == self.recipe.name and found.fingerprint in accepted:
            return
        changes = differences(found.recipe, plain(self.recipe))
        listed = ", ".join(changes[:MAX_LISTED]) + (", …" if len(changes) > MAX_LISTED else "")
        raise CheckpointError(
            f"{found.folder}: expected a checkpoint of stage {self.recipe.name} with fingerprint "
            f"{self.run.fingerprint}, got stage {found.stage} with {found.fingerprint} "
            f"({listed or 'the recipe of the stage is the same: model, seed or data differ'}); "
            "choose another folder, or the recipe it was made with"
        )

    def _describe(self, progress: Progress) -> dict[str, Any]:
        return {
            "stage": self.recipe.name,
            "fingerprint": self.run.fingerprint,
            "recipe": plain(self.recipe),
            "progress": progress.to_json(),
            "processes": self.processes.count,
            "parallel": self.run.trainer.parallel,
            "versions": {"diff4splat": __version__, "torch": torch.__version__},
        }

    def _publish(self, staging: Path, target: Path, state: Mapping[str, Any]) -> None:
        write_state(staging, state)
        if target.exists():  # damaged, or never named by ``latest``
            _remove(target)
        os.replace(staging, target)
        write_text(self.folder / LATEST_FILE, target.name + "\n")
        self._prune(target.name, calm=not state["progress"]["spikes_in_a_row"])

    def _prune(self, newest: str, calm: bool) -> None:
        """Drop all but the newest few; amid spikes nothing goes, as the way back may need it."""
        names = sorted(candidates(self.folder), key=order, reverse=True)
        for name in names[max(1, self.run.trainer.keep_checkpoints) :] if calm else []:
            if name != newest:
                _remove(self.folder / name)


def plain(recipe: StageRecipe) -> dict[str, Any]:
    """A recipe as JSON would give it back."""
    return _as_lists(asdict(recipe))


def differences(before: Mapping[str, Any], now: Mapping[str, Any], prefix: str = "") -> list[str]:
    """Settings that differ, in words."""
    found = []
    for key in sorted({*before, *now}):
        old, new = before.get(key), now.get(key)
        if isinstance(old, Mapping) and isinstance(new, Mapping):
            found += differences(old, new, f"{prefix}{key}.")
        elif old != new:
            found.append(f"{prefix}{key}: {old} became {new}")
    return found


def _as_lists(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _as_lists(inner) for key, inner in value.items()}
    return [_as_lists(inner) for inner in value] if isinstance(value, list | tuple) else value


def _make_empty(folder: Path) -> None:
    for leftover in folder.parent.glob(".partial-*"):
        shutil.rmtree(leftover, ignore_errors=True)
    folder.mkdir(parents=True)


def _remove(folder: Path) -> None:
    """Renamed first: a half removed checkpoint must not look like a damaged one."""
    hidden = folder.with_name(f".partial-removed-{folder.name}")
    shutil.rmtree(hidden, ignore_errors=True)
    os.replace(folder, hidden)
    shutil.rmtree(hidden, ignore_errors=True)
