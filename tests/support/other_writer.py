"""Another process that writes, holds its locks until it is told to end, and can be killed."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

WRITE_AND_WAIT = """
import sys
from pathlib import Path
from diff4splat.io.atomic import atomic_folder, atomic_path
kind, target = sys.argv[1], Path(sys.argv[2])
with {"file": atomic_path, "folder": atomic_folder}[kind](target) as temporary:
    (temporary if kind == "file" else temporary / "a.txt").write_text("half")
    print("writing", flush=True)
    sys.stdin.readline()
    (temporary if kind == "file" else temporary / "a.txt").write_text("theirs")
"""


@contextmanager
def other_process(kind: str, target: Path) -> Iterator[subprocess.Popen]:
    """One that writes ``target`` and waits for a line before it ends."""
    command = [sys.executable, "-c", WRITE_AND_WAIT, kind, str(target)]
    process = subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, cwd=os.getcwd()
    )
    try:
        assert process.stdout.readline() == "writing\n"
        yield process
    finally:
        process.kill()
        process.communicate()


def kill(process: subprocess.Popen) -> None:
    process.kill()
    assert process.wait() == -signal.SIGKILL
