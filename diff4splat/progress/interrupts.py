"""Requests to stop this process, recorded so that nothing can swallow them.

A signal raises ``KeyboardInterrupt`` wherever the main thread is. Python drops an exception inside
a finaliser or a callback of compiled code, and compiled modules turn it into another error. So the
handler also records the request, and phases and renames look at that record.
"""

import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

# Windows has no hang-up.
STOP_SIGNALS = tuple(
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
)


class _Stop:
    """What this process knows about a stop."""

    requested = False
    carried_out = False


class _Thread(threading.local):
    """How many blocks of this thread signals must wait for."""

    blocks = 0


_STOP, _THREAD = _Stop(), _Thread()


def handle_stop_signals(handler: Callable[[int, Any], None] | None = None) -> None:
    """Record and raise ``KeyboardInterrupt`` on Ctrl-C, SIGTERM and SIGHUP, or call ``handler``.

    A signal that is ignored stays so: that is what ``nohup`` and background jobs ask for.
    """
    for number in STOP_SIGNALS:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, handler or _on_signal)
    sys.unraisablehook, threading.excepthook = _report_unraisable, _report_in_thread


def is_stop_requested() -> bool:
    """Whether a signal asked this process to stop."""
    return _STOP.requested


def raise_if_stopped() -> None:
    """Stop here if a signal came, even if its exception was dropped.

    Raises:
        KeyboardInterrupt: a signal came, and this is not an ``uninterrupted`` block.
    """
    if _STOP.requested and not _STOP.carried_out and not _THREAD.blocks:
        raise KeyboardInterrupt


def carry_out_stop() -> None:
    """The process is about to end because of a signal: further ones change nothing."""
    _STOP.carried_out = _STOP.requested


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Signals during the block are raised after it: for renames, clean-up and last saves."""
    before = _STOP.requested
    _THREAD.blocks += 1
    try:
        yield
    finally:
        _THREAD.blocks -= 1
    if not before:
        raise_if_stopped()


def _on_signal(number: int, frame: Any) -> None:
    del number, frame
    _STOP.requested = True
    raise_if_stopped()


def _report_unraisable(dropped: Any) -> None:
    """As Python does, but silently once a signal came: what is dropped then is the stop."""
    if not _STOP.requested:
        sys.__unraisablehook__(dropped)


def _report_in_thread(failed: Any) -> None:
    """The same for threads."""
    if not _STOP.requested:
        threading.__excepthook__(failed)
