"""``diff4splat prepare pipeline``: import, alignment, captions and scores in tasks."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from diff4splat.cli.options.constraints import InputPath, Number


@dataclass(frozen=True, kw_only=True)
class PreparePipeline:
    """Import, align, caption and score a data set in tasks, here or on a cluster (datatrove)."""

    settings: Annotated[
        Path, tyro.conf.Positional, InputPath(what="settings of a pipeline", folder=False)
    ]
    """TOML file: the steps, the number of tasks, and the executor (local, slurm or ray)."""
    task: Annotated[int | None, Number(least=0)] = None
    """Run this task alone, here, without datatrove: for xargs, or another scheduler."""
    again: bool = False
    """Run complete tasks too, after files were repaired; finished clips are kept."""
    show: bool = False
    """Print the executor and what is complete; run nothing."""

    def check(self) -> None:
        """Read the settings before anything runs."""
        from diff4splat.data_prep.pipeline.settings import read_settings

        settings = read_settings(self.settings)
        if self.task is not None:
            Number(least=0, most=settings.tasks - 1).check("--task", self.task)

    def run(self) -> None:
        """Run one task, or all that are not complete."""
        from diff4splat.cli.common.console import ConsolePhases, note
        from diff4splat.data_prep.pipeline.executors import build_executor, described, run_executor
        from diff4splat.data_prep.pipeline.settings import read_settings
        from diff4splat.data_prep.pipeline.task import check_settings, result_folder, run_task

        settings, phases = read_settings(self.settings), ConsolePhases()
        check_settings(settings)
        if self.show:
            print(described(build_executor(settings, self.again)))
        elif self.task is not None:
            found = run_task(settings, self.task, phases)
            note(f"{found.clips} clips in {found.folder}, {found.failed} unusable: see its reports")
        else:
            run_executor(settings, phases, self.again)
            note(f"next: diff4splat prepare curate {result_folder(settings)}/part-* --out report")
