"""Polite stops: the first SIGTERM, SIGHUP or Ctrl-C ends training after the step.

The second one ends it at once.
"""

import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

from diff4splat.progress.interrupts import STOP_SIGNALS
from diff4splat.training.trainer.settings import Outcome, RunSettings


class StopRequest:
    """Why this process would like to stop."""

    def __init__(self, run: RunSettings) -> None:
        self._run, self._began = run, time.monotonic()
        self._signalled = False

    def signalled(self) -> None:
        """Note that a signal came."""
        self._signalled = True

    def reason(self, steps_of_call: int) -> Outcome | None:
        """None to go on."""
        if self._signalled:
            return "signalled"
        run = self._run
        if run.stop_after_steps is not None and steps_of_call >= run.stop_after_steps:
            return "step_limit"
        elapsed_s = time.monotonic() - self._began
        if run.stop_after_s is not None and elapsed_s >= run.stop_after_s:
            return "time_limit"
        return None


@contextmanager
def stop_request(run: RunSettings) -> Iterator[StopRequest]:
    """Watch the limits of a call, and signals where Python allows it: in the main thread."""
    request = StopRequest(run)
    if threading.current_thread() is not threading.main_thread():
        yield request
        return
    before = {number: signal.getsignal(number) for number in STOP_SIGNALS}

    def restore() -> None:
        for number, handler in before.items():
            signal.signal(number, handler)

    def on_signal(number: int, frame: object) -> None:
        del number, frame
        request.signalled()
        restore()  # the next one does what it would have done without us

    for number in STOP_SIGNALS:
        # `nohup` and background jobs ignore some.
        if before[number] is not signal.SIG_IGN:
            signal.signal(number, on_signal)
    try:
        yield request
    finally:
        restore()
