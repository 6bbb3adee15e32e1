"""``diff4splat report skipped``: what runs leave out, measured on eight inputs."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated

from diff4splat.cli.options.constraints import InputPath, Number, OutFolder

if TYPE_CHECKING:
    from diff4splat.evaluation.skipped.measurement import Item
    from diff4splat.scene.scene import Scene

WORLDS = ((7, 3), (11, 0), (19, 5), (23, 8), (29, 2), (31, 4), (37, 6), (41, 1))
"""(seed, index); the first ones make up the number where photographs are named."""
INPUTS = 8


@dataclass(frozen=True, kw_only=True)
class Skipped:
    """Measure what runs leave out: seconds, bytes and error, with a table and a picture.

    Eight inputs: the photographs and scenes that are named, and drawn worlds, every second one with
    a prompt.
    """

    out: OutFolder = Path("skipped")
    """Folder for the table, the picture and JSON."""
    images: Annotated[tuple[Path, ...], InputPath(what="a photograph", folder=False)] = ()
    """Photographs to measure on."""
    scenes: Annotated[tuple[Path, ...], InputPath(what="a scene file", folder=False)] = ()
    """Scene files to measure on, such as fits."""
    resolution: Annotated[int, Number(least=64, most=1024)] = 256
    """Image size: the side of a square with the same area, in pixels."""

    def run(self) -> None:
        """Measure, write, print the table."""
        from diff4splat.cli.common.console import ConsolePhases, note
        from diff4splat.cli.common.installation import single_gaussian
        from diff4splat.cli.common.precompile import precompile_renderer
        from diff4splat.evaluation.skipped.measurement import measure
        from diff4splat.evaluation.skipped.skipped_report import to_markdown, write_skipped
        from diff4splat.io.figures.plots import require_matplotlib

        require_matplotlib()
        phases, rows = ConsolePhases(), []
        precompile_renderer(single_gaussian("cpu"), phases)
        with TemporaryDirectory(prefix="diff4splat-skipped-") as folder:
            inputs = list(self.inputs(Path(folder)))
            with phases.phase("measure", len(inputs)) as advance:
                for name, items in inputs:
                    rows += [measure(item, name) for item in items()]
                    advance()
        files = write_skipped(rows, self.out)
        print(to_markdown(rows))
        note(f"wrote {', '.join(file.name for file in files)} to {self.out}")

    def inputs(self, folder: Path) -> "Iterator[tuple[str, object]]":
        """(name, function that gives the items) of every input."""
        from diff4splat.cli.calibration.calibration_inputs import PROMPT, draw_photos
        from diff4splat.evaluation.skipped.generation_items import Source
        from diff4splat.io.scene_files.scene_file import load_scene

        drawn = max(INPUTS - len(self.images) - len(self.scenes), 0)
        photos = [(photo, None) for photo in self.images]
        for k, photo in enumerate(draw_photos(folder, WORLDS[:drawn])):
            photos.append((photo, PROMPT if k % 2 else None))
        for photo, prompt in photos:
            source = Source.of(photo, self.resolution, prompt)
            yield source.name, lambda source=source: _photo_items(source)
        for file in self.scenes:
            yield file.stem, lambda file=file: _scene_items(load_scene(file))


def _photo_items(source) -> "Iterator[Item]":
    from diff4splat.evaluation.skipped.generation_items import generation_items

    yield from generation_items(source)
    yield from _scene_items(source.scene(source.prompt))


def _scene_items(scene: "Scene") -> "Iterator[Item]":
    from diff4splat.evaluation.skipped.scene_items import scene_items

    yield from scene_items(scene)
