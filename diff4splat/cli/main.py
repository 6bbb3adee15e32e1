"""``diff4splat``: one command per file; torch is imported only inside the command that runs."""

import os
import signal
import sys
from typing import Annotated, NoReturn

import tyro

from diff4splat.cli.bake import Bake
from diff4splat.cli.convert import Convert
from diff4splat.cli.doctor import Doctor
from diff4splat.cli.evaluate import Evaluate
from diff4splat.cli.fit import Fit
from diff4splat.cli.generate import Generate
from diff4splat.cli.inspect import Inspect
from diff4splat.cli.pack import Pack
from diff4splat.cli.paths import ListPaths, PreviewPath
from diff4splat.cli.prepare import PrepareCheck, PrepareLatents, PrepareSynthetic
from diff4splat.cli.render import Render
from diff4splat.cli.report import ErrorTime, ListKnobs
from diff4splat.cli.train import Train
from diff4splat.errors import Diff4SplatError, InputError

subcommand = tyro.conf.subcommand
Paths = Annotated[PreviewPath, subcommand("preview")] | Annotated[ListPaths, subcommand("list")]
Prepare = (
    Annotated[PrepareSynthetic, subcommand("synth")]
    | Annotated[PrepareLatents, subcommand("latents")]
    | Annotated[PrepareCheck, subcommand("check")]
)
Report = Annotated[ErrorTime, subcommand("error-time")] | Annotated[ListKnobs, subcommand("knobs")]
Command = (
    Annotated[Generate, subcommand("generate")]
    | Annotated[Fit, subcommand("fit")]
    | Annotated[Render, subcommand("render")]
    | Annotated[Bake, subcommand("bake")]
    | Annotated[Convert, subcommand("convert")]
    | Annotated[Paths, subcommand("paths", description="Camera paths: list and draw them.")]
    | Annotated[Inspect, subcommand("inspect")]
    | Annotated[Report, subcommand("report", description="Error against run time.")]
    | Annotated[Prepare, subcommand("prepare", description="Training clips: make, encode, check.")]
    | Annotated[Train, subcommand("train")]
    | Annotated[Pack, subcommand("pack")]
    | Annotated[Evaluate, subcommand("eval")]
    | Annotated[Doctor, subcommand("doctor")]
)
BAD_INPUT, INTERRUPTED, PIPE_CLOSED = 2, 130, 141


def main() -> NoReturn:
    """Run the command line; user errors end in one line and exit code 2."""
    # Threads that wait must sleep: with a core busy elsewhere, spinning ones make small parallel
    # loops up to fifty times slower. Read once, when torch is loaded.
    os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
    try:
        code = run(sys.argv[1:])
        sys.stdout.flush()
    except BrokenPipeError:
        # `diff4splat ... | head` ends quietly; nothing may be written to the closed pipe again.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = PIPE_CLOSED
    if code == INTERRUPTED:
        # Python remembers an interrupt that passed through the import of a compiled module, and
        # would end by that signal instead of with our exit code, handled or not.
        sys.stderr.flush()
        os._exit(code)
    sys.exit(code)


def run(arguments: list[str]) -> int:
    """Run one command; returns the exit code."""
    command = tyro.cli(
        Command,
        prog="diff4splat",
        description="One image, a camera path and optional text to an explicit 4D Gaussian scene.",
        args=arguments,
        config=(tyro.conf.OmitSubcommandPrefixes, tyro.conf.FlagCreatePairsOff),
    )
    # SIGTERM and SIGHUP unwind like Ctrl-C, so that staged files are removed.
    for stop in ("SIGTERM", "SIGHUP"):
        if hasattr(signal, stop):
            signal.signal(getattr(signal, stop), signal.default_int_handler)
    try:
        require_readable(arguments)
        command.run()
    except Diff4SplatError as error:
        from diff4splat.cli.common.console import fail

        fail(error)
        return BAD_INPUT
    except KeyboardInterrupt:
        from diff4splat.cli.common.console import note

        note("diff4splat: stopped; no half-written file was left")
        return INTERRUPTED
    return 0


def require_readable(arguments: list[str]) -> None:
    """Reject arguments that are not UTF-8: image and video libraries crash on them.

    Raises:
        InputError: an argument has bytes that are not UTF-8.
    """
    for argument in arguments:
        try:
            argument.encode()
        except UnicodeEncodeError as error:
            raise InputError(
                f"argument {argument!r}: expected a name in UTF-8, got other bytes; rename the file"
            ) from error


if __name__ == "__main__":
    main()
