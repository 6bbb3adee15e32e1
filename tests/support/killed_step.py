"""A command in a process of its own that kills itself before its n-th change of files.

Changes are what Python announces to audit hooks: files opened for writing, renamed, removed, and
folders made. A number beyond the last change lets the command finish; the count comes back.
"""

import contextlib
import multiprocessing
import os
import signal
import sys
from multiprocessing.connection import Connection

PRELOADED = ("killed_step", "diff4splat.data_prep.pipeline.task", "diff4splat.cli.main")
NEVER = sys.maxsize
_CHANGES = {"os.rename", "os.remove", "os.rmdir", "os.mkdir", "shutil.rmtree"}


def changes_of(arguments: list[str], kill_at: int = NEVER) -> int | None:
    """Run a command of ``diff4splat``; how often it changed files, None where it was killed.

    Processes are forked from one that has the modules already: each costs what its work costs.
    """
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(list(PRELOADED))
    ours, theirs = context.Pipe()
    process = context.Process(target=_run, args=(arguments, kill_at, theirs))
    process.start()
    theirs.close()
    process.join()
    if process.exitcode == -signal.SIGKILL:
        return None
    assert process.exitcode == 0, f"{arguments}: exit code {process.exitcode}"
    return ours.recv()


def _run(arguments: list[str], kill_at: int, answer: Connection) -> None:
    from diff4splat.cli.main import run

    count = 0

    def watch(event: str, given: tuple) -> None:
        nonlocal count
        if event in _CHANGES or (event == "open" and _is_written(given)):
            count += 1
            if count == kill_at:
                os.kill(os.getpid(), signal.SIGKILL)

    sys.addaudithook(watch)
    with open(os.devnull, "w") as silent, contextlib.redirect_stderr(silent):
        code = run(arguments)
    answer.send(count)
    sys.exit(code)


def _is_written(given: tuple) -> bool:
    """(path, mode, flags) of a file that is opened; descriptors and pipes do not count."""
    path, mode, flags = given
    if not isinstance(path, (str, bytes)) or path == os.devnull:
        return False
    return bool(flags & (os.O_WRONLY | os.O_RDWR)) or (mode is not None and mode[:1] in "wxa")
