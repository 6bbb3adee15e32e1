"""Tasks by datatrove: two workers here, Slurm and Ray by their settings."""

import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest
from several_sequences import write_sequences, write_settings

from diff4splat.cli.main import run
from diff4splat.data.clip_folder import ClipFolder
from diff4splat.data_prep.pipeline import executors
from diff4splat.data_prep.pipeline.executors import TaskStep, build_executor, described
from diff4splat.data_prep.pipeline.settings import read_settings
from diff4splat.errors import ConfigError, MissingExtraError
from diff4splat.progress.phases import Phases

needs_datatrove = pytest.mark.skipif(
    find_spec("datatrove") is None, reason="needs the extra diff4splat[cluster]"
)
ALONE = "import sys; from diff4splat.cli.main import run; sys.exit(run(sys.argv[1:]))"
SLURM = """
[executor]
kind = "slurm"
workers = 8
partition = "cpu"
qos = "low"
time = "02:30:00"
cpus_per_task = 2
memory_gb_per_cpu = 6
environment = "source /shared/venv/bin/activate"
[executor.sbatch]
account = "vision"
"""


def shards(work: Path) -> dict[str, bytes]:
    files = [*work.rglob("shard-*"), *work.rglob("manifest.json"), *work.rglob("scores.jsonl")]
    return {str(file.relative_to(work)): file.read_bytes() for file in files}


@pytest.mark.slow
@needs_datatrove
def test_two_workers_do_what_tasks_one_by_one_do(tmp_path: Path) -> None:
    for name in ("one by one", "datatrove"):
        (tmp_path / name).mkdir()
        write_sequences(tmp_path / name / "copy", 5, damaged=(3,))
    alone = str(write_settings(tmp_path / "one by one", 3))
    for task in range(3):
        assert run(["prepare", "pipeline", alone, "--task", str(task)]) == 0
    file = write_settings(tmp_path / "datatrove", 3, "[executor]\nworkers = 2")
    command = [sys.executable, "-c", ALONE, "prepare", "pipeline", str(file)]
    same_code = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    ended = subprocess.run(command, check=False, capture_output=True, env=same_code)
    assert ended.returncode == 0, ended.stderr.decode()
    assert shards(tmp_path / "datatrove" / "work") == shards(tmp_path / "one by one" / "work")
    assert sum(len(ClipFolder(p)) for p in (file.parent / "work" / "imported").iterdir()) == 4
    shown = described(build_executor(read_settings(file)))
    assert "workers: 2" in shown and "complete: 3 of 3 tasks" in shown


@needs_datatrove
def test_slurm_gets_what_the_settings_say(tmp_path: Path) -> None:
    settings = read_settings(write_settings(tmp_path, 64, SLURM))
    executor = build_executor(settings)
    assert (executor.tasks, executor.workers, executor.partition) == (64, 8, "cpu")
    assert (executor.time, executor.qos) == ("02:30:00", "low")
    assert (executor.cpus_per_task, executor.mem_per_cpu_gb) == (2, 6)
    assert executor.pipeline == [TaskStep(settings)]
    script = executor.get_launch_file_contents(executor.get_sbatch_args(64), "run-a-task")
    assert "#SBATCH --array=0-63%8" in script and "#SBATCH --account=vision" in script
    assert script.index("source /shared/venv/bin/activate") < script.index("run-a-task")
    text = described(executor)
    assert "executor: SlurmPipelineExecutor" in text and "sbatch account: vision" in text
    assert "complete: 0 of 64 tasks" in text


@needs_datatrove
def test_without_slurm_here_it_says_where_to_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    settings = read_settings(write_settings(tmp_path, 2, SLURM))
    with pytest.raises(ConfigError, match="expected the command sbatch"):
        executors.run_executor(settings, Phases())


@needs_datatrove
def test_ray_gets_what_the_settings_say(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The executor loads ray when it runs, so that it can be built without."""
    monkeypatch.setattr(executors, "_require_packages", lambda *names: None)
    more = "[executor]\nkind = 'ray'\nworkers = -1\ncpus_per_task = 2\nmemory_gb_per_cpu = 3"
    executor = build_executor(read_settings(write_settings(tmp_path, 7, more)))
    assert (executor.tasks, executor.workers) == (7, 7)
    assert (executor.cpus_per_task, executor.mem_per_cpu_gb) == (2, 3)


@pytest.mark.parametrize(("kind", "lacks"), [("local", "datatrove"), ("ray", "ray")])
def test_a_missing_package_is_one_clear_line(
    kind: str, lacks: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(executors, "find_spec", lambda name: None if name == lacks else name)
    settings = read_settings(write_settings(tmp_path, 2, f"[executor]\nkind = '{kind}'"))
    with pytest.raises(MissingExtraError, match=f"expected {lacks}, .* with --task"):
        build_executor(settings)
