"""Processes that work together, started as ``torchrun`` starts them."""

import os
import socket
import subprocess
import sys
from pathlib import Path

SUPPORT = Path(__file__).parent


def free_port() -> int:
    """A port of this machine that nobody uses."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return free.getsockname()[1]


def launch(script: str, argument: Path, errors: Path, count: int = 2) -> list[int]:
    """Exit codes of ``count`` processes of a script in this folder."""
    port = str(free_port())
    shared = {"WORLD_SIZE": str(count), "MASTER_ADDR": "127.0.0.1", "MASTER_PORT": port}
    shared = os.environ | shared | {"OMP_NUM_THREADS": "1"}
    command = [sys.executable, str(SUPPORT / script), str(argument)]
    with errors.open("w") as stream:
        running = [
            subprocess.Popen(
                command,
                env=shared | {"RANK": str(rank), "LOCAL_RANK": str(rank)},
                stdout=stream,
                stderr=stream,
            )
            for rank in range(count)
        ]
        try:
            return [process.wait(timeout=400) for process in running]
        finally:
            for process in running:
                process.kill()
