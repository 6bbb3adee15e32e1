"""The recipes of the guide run as they stand, with a stand-in that notes what it is asked to do."""

import os
import re
import subprocess
from pathlib import Path

import pytest

from diff4splat.cli.common.parser import parse
from diff4splat.data_prep.pipeline.settings import read_settings
from diff4splat.data_prep.pipeline.task import check_settings

GUIDE = Path(__file__).parents[4] / "docs" / "guide" / "train-at-scale.md"
NOTING = '#!/bin/sh\necho "$@" >> "$NOTES"\n'
SBATCH = """#!/bin/bash
tasks=${1#--array=0-}
for task in $(seq 0 $tasks); do SLURM_ARRAY_TASK_ID=$task bash -c "$3"; done
"""


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", GUIDE.read_text(), re.DOTALL)


def noted(script: str, folder: Path) -> list[list[str]]:
    """Arguments of every call of diff4splat."""
    for name, text in (("diff4splat", NOTING), ("sbatch", SBATCH)):
        (folder / name).write_text(text)
        (folder / name).chmod(0o755)
    path = f"{folder}{os.pathsep}{os.environ['PATH']}"
    environment = os.environ | {"PATH": path, "NOTES": str(folder / "notes")}
    subprocess.run(["bash", "-ec", script], check=True, cwd=folder, env=environment)
    return [line.split() for line in (folder / "notes").read_text().splitlines()]


@pytest.mark.parametrize(
    ("begins", "tasks"),
    [
        ("seq 0 63", 64),
        pytest.param("sbatch --array=0-63", 64, marks=pytest.mark.slow),
        ("seq 0 7", 8),
    ],
)
def test_every_task_is_run_once(begins: str, tasks: int, tmp_path: Path) -> None:
    (script,) = [block for block in blocks("bash") if block.startswith(begins)]
    calls = noted(script, tmp_path)
    numbers = [int(call[call.index("--task") + 1]) for call in calls]
    assert sorted(numbers) == list(range(tasks))
    for number, call in zip(numbers, calls, strict=True):
        command = parse(call)
        assert command.task == number
        if call[1] == "import":
            assert command.tasks == tasks and command.out.name == f"part-{number}"


def test_settings_of_the_guide_are_valid(tmp_path: Path) -> None:
    whole, slurm = blocks("toml")
    file = tmp_path / "pipeline.toml"
    file.write_text(whole)
    check_settings(read_settings(file))
    file.write_text(whole[: whole.index("[executor]")] + slurm)
    assert read_settings(file).executor.sbatch == {"account": "vision"}
