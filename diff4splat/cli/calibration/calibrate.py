"""``diff4splat report calibrate``: costs and errors of settings, measured on this machine."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from diff4splat.cli.options.constraints import InputPath, OutputFile

if TYPE_CHECKING:
    from diff4splat.cli.calibration.calibration_record import CalibrationRecord
    from diff4splat.cli.calibration.calibration_runs import Costs
    from diff4splat.outputs.budgets.table import CalibrationTable, SettingRow
    from diff4splat.progress.phases import Phases


@dataclass(frozen=True, kw_only=True)
class Calibrate:
    """Measure what commands cost here and what each setting loses; takes minutes.

    A call that is stopped goes on where it was. `--tolerance`, `--budget` and `forecast` then use
    the table.
    """

    out: Annotated[Path | None, OutputFile(suffixes=(".json",))] = None
    """Table to write. Default: in the user's cache, where commands find it."""
    images: Annotated[tuple[Path, ...], InputPath(what="a photograph", folder=False)] = ()
    """Photographs to measure on, beside two drawn worlds."""
    rates_only: bool = False
    """Measure times and memory alone, and keep the errors of the table in use: faster."""
    train: bool = False
    """Also train stages of the recipe test for a few steps; else the rates in use are scaled."""
    onnx: bool = False
    """Also export the model test as ONNX graphs, which takes a minute; else as above."""

    def run(self) -> None:
        """Measure and write; a call that was stopped is gone on with."""
        from diff4splat.cli.calibration.calibration_record import CalibrationRecord
        from diff4splat.cli.common.console import ConsolePhases, note
        from diff4splat.outputs.budgets.table import user_table_file, write_table

        file = self.out or user_table_file()
        parts = file.with_name(f"{file.stem}.parts")
        record = CalibrationRecord(parts, self.inputs())
        if record.numbers:
            note(f"going on from an interrupted calibration: {parts}")
        table = self.measure(record, ConsolePhases())
        write_table(table, file)
        record.remove()
        note(f"wrote {file}")

    def inputs(self) -> dict[str, object]:
        """What the numbers depend on."""
        from hashlib import sha256

        return {
            "images": [sha256(image.read_bytes()).hexdigest() for image in self.images],
            "rates_only": self.rates_only,
            "train": self.train,
            "onnx": self.onnx,
        }

    def measure(self, record: "CalibrationRecord", phases: "Phases") -> "CalibrationTable":
        """All rates, then all errors."""
        from diff4splat import __version__
        from diff4splat.outputs.budgets.speed import machine_name
        from diff4splat.outputs.budgets.table import CalibrationTable, find_table

        known = find_table()
        photos, costs = self.costs(record, phases)
        rows = known.settings if self.rates_only else self.errors(record, photos, phases)
        return CalibrationTable(
            diff4splat=__version__,
            machine=machine_name(),
            speed_s=costs.speed_s,
            load=round(costs.load, 1),
            inputs=tuple(photo.stem for photo in photos),
            rates=known.rates_at(costs.speed_s) | costs.rates,
            settings=rows,
        )

    def costs(self, record: "CalibrationRecord", phases: "Phases") -> tuple[list[Path], "Costs"]:
        """(photos, rates of all commands); scenes and fits stay in the folder of the record."""
        from diff4splat.cli.calibration import calibration_inputs as inputs
        from diff4splat.cli.calibration import calibration_runs as runs

        folder = record.folder
        with phases.phase("draw inputs", 2) as advance:
            record.once("worlds", lambda: [str(file) for file in inputs.draw_photos(folder)])
            photos = [Path(file) for file in record.numbers["worlds"]]
            photos += inputs.copy_photos(folder, self.images)
            advance()
            warm_up(photos[0], record)
            advance()
        first = runs.generation_runs(photos[0], folder) + runs.fit_runs(folder)
        wide = folder / "wide.safetensors"
        then = runs.scene_runs(folder, wide)
        then += runs.train_runs(folder) if self.train else []
        then += runs.onnx_runs(folder) if self.onnx else []
        with phases.phase("measure costs", len(first) + len(then)) as advance:
            runs.measure_costs(first, record, advance)
            if not wide.exists():
                inputs.widen_scene(runs.scene_file(folder, "fit", runs.FIELD), wide)
            runs.measure_costs(then, record, advance)
        return photos, runs.measure_costs([*first, *then], record, lambda: None)

    def errors(
        self, record: "CalibrationRecord", photos: Sequence[Path], phases: "Phases"
    ) -> dict[str, tuple["SettingRow", ...]]:
        """Rows of every command, from the photos and the scenes that the runs wrote."""
        from diff4splat.cli.calibration import calibration_errors as errors
        from diff4splat.cli.calibration import calibration_runs as runs
        from diff4splat.cli.calibration.scene_errors import scene_errors
        from diff4splat.io.scene_files.scene_file import load_scene

        files = [runs.scene_file(record.folder, "scene", n) for n in (runs.STATIC, runs.PROMPTED)]
        files += [runs.scene_file(record.folder, "fit", n) for n in (runs.FIELD, runs.NATIVE)]
        scenes = [load_scene(file) for file in files]
        photo_errors = []
        with phases.phase("measure errors", len(photos) + len(scenes)) as advance:
            for photo in photos:
                measure = lambda photo=photo: errors.photo_errors(photo)  # noqa: E731
                photo_errors.append(record.once(f"errors of {photo.name}", measure))
                advance()
            found = []
            for file, scene in zip(files, scenes, strict=True):
                measure = lambda scene=scene: scene_errors(scene)  # noqa: E731
                found.append(record.once(f"errors of {file.parent.name}", measure))
                advance()
        return errors.all_rows(photo_errors, scenes, found)


def warm_up(photo: Path, record: "CalibrationRecord") -> None:
    """Draw the captures, and run each command once in short: kernels compile, files are cached."""
    from diff4splat.cli.calibration import calibration_runs as runs
    from diff4splat.cli.calibration.measured_process import measure_process

    folder = record.folder
    for run in (*runs.draw_captures(folder), *runs.warm_up_runs(photo, folder)):
        if run[0] != "prepare" or not Path(run[-1]).exists():
            record.once(f"warm up {run[0]} {run[-1]}", lambda run=run: measure_process(run).seconds)
