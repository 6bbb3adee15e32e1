"""Stops at chosen moments, in a child process that sends the signal to itself."""

import signal
import subprocess
import sys
from pathlib import Path

import pytest

WRITE = """
import atexit, ctypes, gc, os, pathlib, signal, sys, weakref
from diff4splat.cli import main as entry
from diff4splat.io import atomic
from diff4splat.progress.phases import Phases

out = pathlib.Path(sys.argv.pop(1))
FILES = ("a.txt", "b.txt")


def stop():
    signal.raise_signal(NUMBER)


def stage(between=lambda: None):
    with atomic.atomic_folder(out, FILES) as folder:
        for name in FILES:
            (folder / name).write_text(name)
        between()


COMMAND
entry.run_command = command
entry.main()
"""
FINALISER = """
class Stopping:
    def __del__(self):
        stop()


def swallow():
    Stopping()
"""
WEAK_REFERENCE = """
class Thing:
    pass


def swallow():
    thing = Thing()
    reference = weakref.ref(thing, lambda _: stop())
    del thing
"""
CALLBACK = """
def swallow():
    ctypes.CFUNCTYPE(None)(stop)()
"""
EXCEPT = """
def swallow():
    try:
        stop()
    except BaseException:
        pass
"""
SWALLOWED = {
    "finaliser": FINALISER,
    "weak reference": WEAK_REFERENCE,
    "callback": CALLBACK,
    "except": EXCEPT,
}
DURING_RENAMES = """
replace = os.replace


def stopping_replace(source, target):
    stop()
    replace(source, target)


os.replace = stopping_replace
command = lambda arguments: stage()
"""
TWICE = """
import shutil

rmtree = shutil.rmtree


def stopping_rmtree(*arguments, **options):
    stop()
    rmtree(*arguments, **options)


shutil.rmtree = stopping_rmtree
command = lambda arguments: stage(stop)
"""
WRAPPED = """
def command(arguments):
    try:
        stage(stop)
    except KeyboardInterrupt as error:
        raise ImportError("a compiled module says something else") from error
"""
AT_EXIT = """
atexit.register(stop)
command = lambda arguments: stage()
"""


def run_child(
    body: str, out: Path, stop: signal.Signals = signal.SIGTERM
) -> subprocess.CompletedProcess:
    code = WRITE.replace("NUMBER", str(int(stop))).replace("COMMAND", body)
    return subprocess.run(
        [sys.executable, "-c", code, str(out)],
        capture_output=True,
        text=True,
        check=False,
        # Tests may run under nohup, whose children ignore SIGHUP.
        preexec_fn=lambda: signal.signal(signal.SIGHUP, signal.SIG_DFL),
    )


def assert_stopped(done: subprocess.CompletedProcess) -> None:
    assert done.returncode == 130, done.stderr
    assert done.stderr == "diff4splat: stopped; no half-written file was left\n"


@pytest.mark.parametrize("stop", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
@pytest.mark.parametrize("place", SWALLOWED)
def test_a_swallowed_stop_is_not_forgotten(
    place: str, stop: signal.Signals, tmp_path: Path
) -> None:
    body = SWALLOWED[place] + "\ncommand = lambda arguments: stage(swallow)"
    assert_stopped(run_child(body, tmp_path / "out", stop))
    assert list(tmp_path.iterdir()) == []


def test_the_next_step_of_a_phase_ends_a_swallowed_stop(tmp_path: Path) -> None:
    steps = """
def command(arguments):
    with Phases().phase("render", 3) as advance:
        swallow()
        advance()
        print("never reached", file=sys.stderr)
"""
    assert_stopped(run_child(FINALISER + steps, tmp_path / "out"))


def test_files_that_belong_together_appear_together(tmp_path: Path) -> None:
    assert_stopped(run_child(DURING_RENAMES, tmp_path / "out"))
    assert {file.name for file in (tmp_path / "out").iterdir()} == {"a.txt", "b.txt"}


@pytest.mark.parametrize("body", [TWICE, WRAPPED], ids=["second stop", "another error"])
def test_nothing_is_left(body: str, tmp_path: Path) -> None:
    assert_stopped(run_child(body, tmp_path / "out"))
    assert list(tmp_path.iterdir()) == []


def test_a_stop_after_the_work_changes_nothing(tmp_path: Path) -> None:
    done = run_child(AT_EXIT, tmp_path / "out")
    assert (done.returncode, done.stderr) == (0, "")
    assert {file.name for file in (tmp_path / "out").iterdir()} == {"a.txt", "b.txt"}


def test_an_ignored_signal_stays_ignored(tmp_path: Path) -> None:
    body = "signal.signal(signal.SIGHUP, signal.SIG_IGN)\ncommand = lambda arguments: stage(stop)"
    done = run_child(body, tmp_path / "out", signal.SIGHUP)
    assert (done.returncode, done.stderr) == (0, "")


def test_other_errors_keep_their_traceback(tmp_path: Path) -> None:
    done = run_child("command = lambda arguments: 1 / 0", tmp_path / "out")
    assert done.returncode == 1
    assert "ZeroDivisionError" in done.stderr
