"""One command in a process of its own, with its processor time and peak memory."""

import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass

from diff4splat.errors import Diff4SplatError
from diff4splat.progress.phases import peak_of_status

LOOK_S = 0.02
LEAST_BYTES = 4 << 20
"""Any Python that runs has more."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasuredProcess:
    """What a command took."""

    seconds: float
    cpu_seconds: float
    memory_bytes: float | int
    text: str
    """What it printed."""


def measure_process(arguments: Sequence[str]) -> MeasuredProcess:
    """Run ``diff4splat`` with ``arguments``.

    Raises:
        Diff4SplatError: the command failed; says what it said last.
    """
    began = time.perf_counter()
    with tempfile.TemporaryFile() as printed:
        command = [sys.executable, "-m", "diff4splat.cli.main", *arguments]
        process = subprocess.Popen(command, stdout=printed, stderr=printed)
        try:
            status, used, peak = _watched(process.pid)
        except BaseException:
            process.kill()  # A command that nobody waits for would go on, and hold its folder.
            process.wait()
            raise
        process.returncode = os.waitstatus_to_exitcode(status)
        printed.seek(0)
        text = printed.read().decode(errors="replace")
    if process.returncode:
        last = (text.strip().splitlines() or ["nothing"])[-1]
        name = " ".join(arguments[:2])
        raise Diff4SplatError(f"calibration: expected {name} to work, got: {last}")
    return MeasuredProcess(
        seconds=time.perf_counter() - began,
        cpu_seconds=used.ru_utime + used.ru_stime,
        memory_bytes=peak,
        text=text,
    )


def _watched(pid: int) -> tuple[int, resource.struct_rusage, int]:
    """(status, usage, peak memory) of a child, looked at until it ends."""
    peak = 0
    while True:
        peak = max(peak, peak_of_status(f"/proc/{pid}/status"))
        ended, status, used = os.wait4(pid, os.WNOHANG)
        if ended:
            scale = 1 if sys.platform == "darwin" else 1024
            # A short command may have been seen before its program was loaded, and never again.
            seen = peak if peak > LEAST_BYTES else used.ru_maxrss * scale
            return status, used, seen
        time.sleep(LOOK_S)
