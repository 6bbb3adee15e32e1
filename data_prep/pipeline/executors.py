"""Tasks on one machine, a Slurm or a Ray cluster, by datatrove; the only file that imports it.

datatrove runs ``rank`` r of ``world_size`` tasks, keeps a log for each, and marks a rank that is
complete with ``logs/completions/<rank>``. A rank is one task here. Everything else that resumes is
in the task itself, so a rank may also run twice.
"""

import shutil
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from diff4splat.data_prep.pipeline.settings import PipelineSettings
from diff4splat.data_prep.pipeline.task import run_task
from diff4splat.errors import ConfigError, MissingExtraError
from diff4splat.progress.phases import Phases

_LOOK_EVERY_S = 1.0


@dataclass(frozen=True, slots=True)
class TaskStep:
    """The one step of datatrove's pipeline; it travels to other processes and machines."""

    settings: PipelineSettings

    def __repr__(self) -> str:
        return f"diff4splat prepare pipeline: {self.settings.source.dataset}"

    def __call__(self, data: Any, rank: int = 0, world_size: int = 1) -> None:
        """Run one task; whoever changes the number of tasks gets that number."""
        del data
        run_task(replace(self.settings, tasks=world_size), rank, Phases())


def build_executor(settings: PipelineSettings, again: bool = False) -> Any:
    """The executor for ``settings``; nothing runs yet. ``again`` repeats complete ranks.

    Raises:
        MissingExtraError: datatrove, or for Ray ray, is not installed.
    """
    table = settings.executor
    shared = {
        "pipeline": [TaskStep(settings)],
        "tasks": settings.tasks,
        "workers": table.workers,
        "logging_dir": str(log_folder(settings)),
        "skip_completed": not again,
    }
    machine = {"cpus_per_task": table.cpus_per_task, "mem_per_cpu_gb": table.memory_gb_per_cpu}
    _require_packages("datatrove", *(["ray"] if table.kind == "ray" else []))
    from datatrove.executor import (
        LocalPipelineExecutor,
        RayPipelineExecutor,
        SlurmPipelineExecutor,
    )

    if table.kind == "local":
        return LocalPipelineExecutor(**shared)
    if table.kind == "ray":
        return RayPipelineExecutor(**shared, **machine)
    return SlurmPipelineExecutor(
        **shared,
        **machine,
        time=table.time,
        partition=table.partition,
        qos=table.qos,
        job_name="diff4splat",
        env_command=table.environment or None,
        sbatch_args=table.sbatch,
        slurm_logs_folder=str(log_folder(settings) / "slurm"),
    )


def _require_packages(*names: str) -> None:
    for name in names:
        if find_spec(name) is None:
            raise MissingExtraError(
                f"executor: expected {name}, got an installation without it; pip install "
                f"'diff4splat[{'ray' if name == 'ray' else 'cluster'}]', or run the tasks one by "
                "one with --task"
            )


def described(executor: Any) -> str:
    """The executor's settings, one to a line."""
    shown = ("tasks", "workers", "cpus_per_task", "mem_per_cpu_gb", "time", "partition", "qos")
    shown += ("env_command", "skip_completed")
    lines = [f"executor: {type(executor).__name__}", f"logs: {executor.logging_dir.path}"]
    lines += [f"{name}: {getattr(executor, name)}" for name in shown if hasattr(executor, name)]
    options = getattr(executor, "_sbatch_args", {})
    lines += [f"sbatch {key}: {value}" for key, value in options.items()]
    return "\n".join([*lines, f"complete: {_complete(executor)} of {executor.tasks} tasks"])


def _complete(executor: Any) -> int:
    return executor.tasks - len(executor.get_incomplete_ranks(skip_completed=True))


def log_folder(settings: PipelineSettings) -> Path:
    """Where datatrove's logs, statistics and marks of completion go."""
    return settings.out / "logs"


def run_executor(settings: PipelineSettings, phases: Phases, again: bool = False) -> None:
    """Run every task that is not complete; Slurm's are queued, and run when Slurm likes.

    Raises:
        ConfigError: there is no Slurm on this machine.
        MissingExtraError: as ``build_executor``.
        Diff4SplatError: what ended a task; the others may be run again.
    """
    executor = build_executor(settings, again)
    if settings.executor.kind == "slurm":
        if shutil.which("sbatch") is None:
            raise ConfigError(
                "executor slurm: expected the command sbatch, got a machine without it; run this "
                "on a machine from which jobs are submitted"
            )
        executor.run()
        return
    waiting = len(executor.get_incomplete_ranks())
    with phases.phase("tasks", waiting) as advance, _watching(executor, waiting, advance):
        executor.run()


@contextmanager
def _watching(executor: Any, waiting: int, advance: Callable[[], None]) -> Iterator[None]:
    """Advance whenever another rank is marked as complete, whichever process ran it."""
    ended, before = threading.Event(), executor.tasks - waiting

    def look() -> None:
        seen, last = before, False
        while not last:
            last = ended.wait(_LOOK_EVERY_S)
            for _ in range(seen, done := _complete(executor)):
                advance()
            seen = max(seen, done)

    def watch() -> None:
        with suppress(KeyboardInterrupt):  # the main thread sees the stop too
            look()

    watcher = threading.Thread(target=watch, daemon=True)
    watcher.start()
    try:
        yield
    finally:
        ended.set()
        watcher.join()
