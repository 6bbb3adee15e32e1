"""``diff4splat``: one command per file; torch is imported only inside the command that runs.

Signals are handled before anything else is imported, so that a stop at any moment ends alike.
"""

import os
import sys

BAD_INPUT, INTERRUPTED, PIPE_CLOSED = 2, 130, 141


def main() -> None:
    """Run the command line; user errors end in one line and exit code 2."""
    try:
        from diff4splat.progress.interrupts import handle_stop_signals

        handle_stop_signals()
        from diff4splat.io.silence_stderr import separate_python_stderr

        separate_python_stderr()
        # Threads that wait must sleep: with a core busy elsewhere, spinning ones make small
        # parallel loops up to fifty times slower. Read once, when torch is loaded.
        os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
        code = run(sys.argv[1:])
        sys.stdout.flush()
        leave(code)
    except BrokenPipeError:
        # `diff4splat ... | head` ends quietly; nothing may be written to the closed pipe again.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        leave(PIPE_CLOSED)
    except KeyboardInterrupt:
        leave(stopped())


def leave(code: int) -> None:
    """End the process; the work is done, so a stop that comes now only shortens the clean-up."""
    # After an interrupt, threads may wait for ever.
    if code != INTERRUPTED:
        import atexit
        import threading

        from diff4splat.progress.interrupts import handle_stop_signals

        handle_stop_signals(lambda *_: os._exit(code))
        threading._shutdown()
        atexit._run_exitfuncs()
        sys.stdout.flush()
    # Python would now take every object apart, which takes half a second once torch is loaded. And
    # it remembers an interrupt that passed through the import of a compiled module, and would end
    # by that signal instead of with our exit code.
    os._exit(code)


def run(arguments: list[str]) -> int:
    """Run one command; returns the exit code."""
    from diff4splat.errors import Diff4SplatError
    from diff4splat.progress.interrupts import is_stop_requested, raise_if_stopped

    try:
        run_command(arguments)
        raise_if_stopped()
    except BaseException as error:
        # Compiled modules turn a stop into any other error.
        if isinstance(error, KeyboardInterrupt) or is_stop_requested():
            return stopped()
        if isinstance(error, Diff4SplatError):
            return failed(error)
        raise
    return 0


def run_command(arguments: list[str]) -> None:
    """Read the arguments, check them without any large library, and run the command.

    Raises:
        Diff4SplatError: an argument, a file or a setting cannot be used.
    """
    if arguments == ["--version"]:
        from diff4splat import __version__

        print(f"diff4splat {__version__}")
        return
    from diff4splat.cli.common.parser import parse
    from diff4splat.cli.options.constraints import check_arguments

    command = parse(arguments)
    require_readable(arguments)
    check_arguments(command)
    command.run()


def stopped() -> int:
    """Say that a signal ended the command."""
    from contextlib import suppress

    from diff4splat.progress.interrupts import carry_out_stop

    carry_out_stop()
    with suppress(OSError):
        print("diff4splat: stopped; no half-written file was left", file=sys.stderr, flush=True)
    return INTERRUPTED


def failed(error: Exception) -> int:
    """Say what the user can do."""
    from diff4splat.cli.common.console import fail

    fail(error)
    return BAD_INPUT


def require_readable(arguments: list[str]) -> None:
    """Reject arguments that are not UTF-8: image and video libraries crash on them.

    Raises:
        InputError: an argument has bytes that are not UTF-8.
    """
    from diff4splat.errors import InputError

    for argument in arguments:
        try:
            argument.encode()
        except UnicodeEncodeError as error:
            raise InputError(
                f"argument {argument!r}: expected a name in UTF-8, got other bytes; rename the file"
            ) from error


if __name__ == "__main__":
    main()
