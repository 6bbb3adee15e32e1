"""A worker of ``diff4splat serve``: imports everything, waits for one task, generates, ends.

Not a command for people. The task comes on standard input; when that ends, so did the server.
"""

import os
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

from diff4splat.errors import Diff4SplatError
from diff4splat.progress.phases import Advance, Phases
from diff4splat.serving.workers.protocol import Task, message

if TYPE_CHECKING:
    from diff4splat.scene.scene import Scene

FAILED = 1


class ReportedPhases(Phases):
    """Phases as lines for the server."""

    def __init__(self, stream: TextIO) -> None:
        super().__init__()
        self._stream = stream

    @contextmanager
    def bar(self, name: str, steps: int) -> Iterator[Advance]:
        """One line per step."""
        done = 0

        def report() -> None:
            self._stream.write(message(phase=name, done=done, steps=steps))
            self._stream.flush()

        def advance() -> None:
            nonlocal done
            done += 1
            report()

        report()
        yield advance


def main() -> None:
    """Serve one task."""
    # What libraries print must not come between the lines.
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "w")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    _import_all()
    answers.write(message(ready=True))
    answers.flush()
    line = sys.stdin.readline()
    if not line:
        return
    threading.Thread(target=_end_with_server, daemon=True).start()
    answers.write(_answer(Task.from_line(line), ReportedPhases(answers)))
    answers.flush()


def _answer(task: Task, phases: Phases) -> str:
    from diff4splat.cli.generate import Generate
    from diff4splat.cli.options.camera import CameraOptions

    options = dict(task.options)
    camera = CameraOptions(frames=options.pop("frames", None))
    command = Generate(
        images=(Path(task.photo),),
        out=Path(task.out),
        model=task.model,
        options=camera,
        convert=True,
        **options,
    )
    try:
        command.check()
        command.run_one(phases, on_scene=partial(_show, Path(task.preview)))
    except Diff4SplatError as error:
        # Clients know neither this file's name nor its folder.
        return message(refused=str(error).replace(task.photo, "photo"))
    return message(ended=True)


def _show(file: Path, scene: "Scene") -> None:
    """The frame in the middle of the path, seconds before all of them are rendered."""
    from diff4splat.io.photos.images import write_png
    from diff4splat.render.api import render

    middle = len(scene.path) // 2
    camera, time_s = scene.path.cameras[middle], float(scene.path.times_s[middle])
    write_png(render(scene, camera, time_s).rgb.clamp(0, 1), file)


def _end_with_server() -> None:
    """Standard input ends when the server does, however it ends."""
    sys.stdin.read()
    os._exit(FAILED)


def _import_all() -> None:
    """Seconds that no client then waits for."""
    import diff4splat.generation.pipeline
    import diff4splat.outputs.scene_folder  # noqa: F401


if __name__ == "__main__":
    main()
    # Taking everything apart takes half a second.
    os._exit(0)
