"""The end of the process: threads and exit functions are heard, the rest is not taken apart."""

import subprocess
import sys
from pathlib import Path

CHILD = """
import atexit, sys, threading
from diff4splat.cli import main as entry


class Kept:
    def __del__(self):
        print("taken apart")


kept = Kept()


def outlast():
    threading.main_thread().join()
    print("thread")


def command(arguments):
    print("command")
    threading.Thread(target=outlast).start()
    atexit.register(print, "exit function")


entry.run_command = command
entry.main()
"""
ROOT = Path(__file__).parents[3]


def test_threads_and_exit_functions_come_before_the_end() -> None:
    done = subprocess.run(
        [sys.executable, "-c", CHILD], capture_output=True, text=True, check=False, cwd=ROOT
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.splitlines() == ["command", "thread", "exit function"]
