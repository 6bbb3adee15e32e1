"""``diff4splat export html`` and ``diff4splat view``: a scene as a page that any browser plays."""

import tempfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import tyro

from diff4splat.cli.limits.options import LimitOptions
from diff4splat.cli.options.constraints import InputPath, OutputFile, require_writable
from diff4splat.cli.options.guard_overwrite import require_inputs_not_overwritten

PAGE_SUFFIXES = (".html", ".htm")
NO_LIMITS = LimitOptions()


@dataclass(frozen=True, kw_only=True)
class ExportHtml:
    """Write a scene as one HTML page that plays it, without a server or a network."""

    scene: Annotated[Path, tyro.conf.Positional, InputPath(what="a scene or checkpoint")]
    """A scene file, a folder with one, a 4DGaussians model folder, or a checkpoint (.pth) of native
    4D Gaussians."""
    out: Annotated[
        Path | None, OutputFile(suffixes=PAGE_SUFFIXES), tyro.conf.arg(aliases=("-o",))
    ] = None
    """The page. Default: the scene's name with .html beside it."""
    limits: Annotated[LimitOptions, tyro.conf.arg(name="")] = field(default_factory=LimitOptions)

    @property
    def file(self) -> Path:
        """The page."""
        return self.out or scene_source(self.scene).with_suffix(".html")

    def check(self) -> None:
        """Require a place that can be written and is not the input."""
        require_inputs_not_overwritten((scene_source(self.scene),), (self.file,))
        require_writable(self.file, is_folder=False)

    def run(self) -> None:
        """Read, write the page, say what it could not keep."""
        export_page(scene_source(self.scene), self.file, self.limits)


@dataclass(frozen=True, kw_only=True)
class View:
    """Open a scene in the browser of this machine: orbit, play, step through time."""

    scene: Annotated[Path, tyro.conf.Positional, InputPath(what="a scene or checkpoint")]
    """As for `export html`."""

    def run(self) -> None:
        """Write a temporary page and open it."""
        import webbrowser

        from diff4splat.cli.common.console import note

        source = scene_source(self.scene)
        folder = Path(tempfile.mkdtemp(prefix="diff4splat-view-"))
        file = folder / f"{source.stem or 'scene'}.html"
        export_page(source, file)
        if not webbrowser.open(file.as_uri()):
            note(f"no browser was found; open {file} in one")


def scene_source(given: Path) -> Path:
    """The scene file of a folder that `generate` or `fit` wrote; anything else as it is."""
    inside = given / "scene.safetensors"
    return inside if inside.is_file() else given


def export_page(source: Path, file: Path, limits: LimitOptions = NO_LIMITS) -> None:
    """Write the page of any scene that can be read, with what ``limits`` ask for left out.

    Raises:
        InputError, FileFormatError: the scene cannot be read.
        OutputError: the page cannot be written.
    """
    from diff4splat.cli.common.console import ConsolePhases, note
    from diff4splat.cli.limits.exporting import html_loss_db, html_promise, reduced
    from diff4splat.cli.limits.stopwatch import Stopwatch
    from diff4splat.io.checkpoints.import_scene import import_scene
    from diff4splat.viewer.page import write_page

    promised, watch = html_promise(source, limits), Stopwatch.of_process()
    for line in promised.lines():
        note(line)
    imported = import_scene(source)
    scene = imported.scene
    if promised.choice is not None:
        scene = reduced(scene, promised.choice.values)
    with ConsolePhases().phase("write page"):
        written = write_page(scene, file)
    measured = watch.read()
    if promised.limits.tolerance_db is not None:
        measured["loss_db"] = html_loss_db(imported.scene, scene)
    for line in promised.after(measured):
        note(line)
    for line in (*imported.notes, *written.notes):
        note(line)
    note(f"wrote {file} ({file.stat().st_size / 1e6:.1f} MB)")
