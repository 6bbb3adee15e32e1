"""Training that is killed and started again ends as one that nothing disturbed, in every part."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from training_commands import SAVING, arguments, assert_same, contents, weights

from diff4splat.cli.main import run

KILLED = Path(__file__).parents[1] / "support" / "killed_command.py"


@pytest.mark.parametrize(
    ("moment", "number"), [("update", 4), pytest.param("hand-over", 2, marks=pytest.mark.slow)]
)
def test_a_killed_run_is_finished_by_the_same_command(
    moment: str, number: int, six_steps: Path, shards: Path, tmp_path: Path
) -> None:
    given = arguments("vae", shards, tmp_path, *SAVING, steps=6)
    killed = [sys.executable, str(KILLED), moment, str(number), *given]
    same_code = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    ended = subprocess.run(killed, check=False, capture_output=True, env=same_code)
    assert ended.returncode == -signal.SIGKILL, ended.stderr
    assert run(given) == 0
    assert_same(weights(tmp_path), weights(six_steps))
    # Parts that the stage does not train, too, byte by byte.
    models = [contents(folder / "model") for folder in (tmp_path, six_steps)]
    assert {file.name: data for file, data in models[0].items()} == {
        file.name: data for file, data in models[1].items()
    }
    assert not list(tmp_path.rglob(".partial-*"))
