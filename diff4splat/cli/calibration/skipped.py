"""``diff4splat report skipped``: what runs leave out, measured on eight inputs."""

from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated

from diff4splat.cli.options.constraints import InputPath, Number, OutFolder

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from diff4splat.evaluation.skipped.measurement import Item, Measured
    from diff4splat.evaluation.skipped.skipped_report import SkippedReport
    from diff4splat.progress.phases import Phases

WORLDS = ((7, 3), (11, 0), (19, 5), (23, 8), (29, 2), (31, 4), (37, 6), (41, 1))
"""(seed, index); the first ones make up the number where photographs are named."""
INPUTS = 8


@dataclass(frozen=True, kw_only=True)
class Skipped:
    """Measure what runs leave out: seconds, bytes and error, with a table and a picture.

    A call that is stopped goes on where it was.

    Eight inputs: the photographs and scenes that are named, and drawn worlds, every second one with
    a prompt.
    """

    out: OutFolder = Path("skipped")
    """Folder for the table, the picture and JSON."""
    images: Annotated[tuple[Path, ...], InputPath(what="a photograph", folder=False)] = ()
    """Photographs to measure on."""
    scenes: Annotated[tuple[Path, ...], InputPath(what="a scene file", folder=False)] = ()
    """Scene files to measure on, such as fits."""
    resolution: Annotated[int, Number(least=64, most=1024)] = 128
    """Image size: the side of a square with the same area, in pixels."""

    def run(self) -> None:
        """Measure, write, print the table; a call that was stopped is gone on with."""
        from diff4splat.cli.common.console import ConsolePhases, note
        from diff4splat.cli.common.installation import single_gaussian
        from diff4splat.cli.common.precompile import precompile_renderer
        from diff4splat.evaluation.skipped.skipped_report import to_markdown
        from diff4splat.io.figures.plots import require_matplotlib

        require_matplotlib()
        phases = ConsolePhases()
        precompile_renderer(single_gaussian("cpu"), phases)
        written = self.measured(phases)
        written.partial.remove()
        print(to_markdown(written.rows))
        note(f"wrote {', '.join(file.name for file in written.files)} to {self.out}")

    def measured(self, phases: "Phases") -> "SkippedReport":
        """Rows of all inputs, and the files that hold them; rows are kept for a second call."""
        from diff4splat.cli.common.console import note
        from diff4splat.evaluation.skipped.measurement import Bench
        from diff4splat.evaluation.skipped.partial_rows import PartialRows
        from diff4splat.evaluation.skipped.skipped_report import SkippedReport, write_skipped

        rows: list[Measured] = []
        partial = PartialRows(self.out, {"resolution": self.resolution})
        if partial.rows:
            note(f"going on from an interrupted report: {len(partial.rows)} inputs are measured")
        with TemporaryDirectory(prefix="diff4splat-skipped-") as folder:
            inputs = self.inputs(Path(folder))
            with phases.phase("what runs skip", len(inputs)) as advance:
                for name, items in inputs.items():
                    bench = Bench(name)
                    measure = lambda bench=bench, items=items: [  # noqa: E731
                        bench.measure(item) for item in items()
                    ]
                    rows += partial.once(name, measure)
                    advance()
        return SkippedReport(rows=rows, files=write_skipped(rows, self.out), partial=partial)

    def inputs(self, folder: Path) -> "dict[str, Callable[[], Iterator[Item]]]":
        """Functions that give the items of every input, by its name."""
        from diff4splat.cli.calibration.calibration_inputs import PROMPT, draw_photos

        drawn = max(INPUTS - len(self.images) - len(self.scenes), 0)
        photos: list[tuple[Path, str | None]] = [(photo, None) for photo in self.images]
        for k, photo in enumerate(draw_photos(folder, WORLDS[:drawn])):
            photos.append((photo, PROMPT if k % 2 else None))
        found = {
            photo.stem: lambda photo=photo, prompt=prompt: self.photo_items(photo, prompt)
            for photo, prompt in photos
        }
        for file in self.scenes:
            name = file.parent.name if file.stem == "scene" else file.stem
            found[name] = lambda file=file: _file_items(file)
        return found

    def photo_items(self, photo: Path, prompt: str | None) -> "Iterator[Item]":
        """What can be left out while a photo becomes a scene, and while that is rendered."""
        from diff4splat.evaluation.skipped.generation_items import Source, generation_items
        from diff4splat.evaluation.skipped.scene_items import scene_items

        source = Source.of(photo, self.resolution, prompt)
        yield from generation_items(source)
        yield from scene_items(source.scene(source.prompt))


def _file_items(file: Path) -> "Iterator[Item]":
    from diff4splat.evaluation.skipped.scene_items import scene_items
    from diff4splat.io.scene_files.scene_file import load_scene

    yield from scene_items(load_scene(file))
