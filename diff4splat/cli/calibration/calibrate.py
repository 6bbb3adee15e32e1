"""``diff4splat report calibrate``: costs and errors of settings, measured on this machine."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated

from diff4splat.cli.options.constraints import InputPath, OutputFile

if TYPE_CHECKING:
    from diff4splat.outputs.budgets.costs import CostRates
    from diff4splat.outputs.budgets.table import CalibrationTable, SettingRow
    from diff4splat.progress.phases import Phases


@dataclass(frozen=True, kw_only=True)
class Calibrate:
    """Measure what commands cost here and what each setting loses; takes minutes.

    `--tolerance`, `--budget` and `diff4splat forecast` then use the table.
    """

    out: Annotated[Path | None, OutputFile(suffixes=(".json",))] = None
    """Table to write. Default: in the user's cache, where commands find it."""
    images: Annotated[tuple[Path, ...], InputPath(what="a photograph", folder=False)] = ()
    """Photographs to measure on, beside four drawn worlds."""
    rates_only: bool = False
    """Measure times and memory alone, and keep the errors of the table in use: faster."""
    train: bool = False
    """Also train stages of the recipe test for a few steps."""

    def run(self) -> None:
        """Measure and write."""
        from diff4splat.cli.common.console import ConsolePhases, note
        from diff4splat.cli.common.installation import single_gaussian
        from diff4splat.cli.common.precompile import precompile_renderer
        from diff4splat.outputs.budgets.table import user_table_file, write_table

        file = self.out or user_table_file()
        phases = ConsolePhases()
        # Compilation must not count.
        precompile_renderer(single_gaussian("cpu"), phases)
        with TemporaryDirectory(prefix="diff4splat-calibration-") as folder:
            table = self.measure(Path(folder), phases)
        write_table(table, file)
        note(f"wrote {file}")

    def measure(self, folder: Path, phases: "Phases") -> "CalibrationTable":
        """All rates, then all errors."""
        from diff4splat import __version__
        from diff4splat.outputs.budgets.speed import machine_name, measure_speed_s
        from diff4splat.outputs.budgets.table import CalibrationTable, find_table

        photos, rates = self.measured_rates(folder, phases)
        settings = find_table().settings if self.rates_only else self.errors(folder, photos, phases)
        return CalibrationTable(
            diff4splat=__version__,
            machine=machine_name(),
            speed_s=measure_speed_s(),
            inputs=tuple(photo.stem for photo in photos),
            rates=rates,
            settings=settings,
        )

    def measured_rates(
        self, folder: Path, phases: "Phases"
    ) -> tuple[list[Path], dict[str, "CostRates"]]:
        """(photos, rates by command); scenes and fits stay in ``folder``."""
        from diff4splat.cli.calibration import calibration_inputs as inputs
        from diff4splat.cli.calibration import calibration_runs as runs
        from diff4splat.cli.calibration.measured_process import measure_process

        with phases.phase("draw inputs", 2) as advance:
            photos = inputs.draw_photos(folder) + inputs.copy_photos(folder, self.images)
            advance()
            measure_process(runs.draw_capture(folder))
            advance()
        every = runs.generation_runs(photos[-1], folder) + runs.fit_runs(folder)
        every += runs.scene_runs(folder)
        every += runs.train_runs(folder) if self.train else []
        with phases.phase("measure costs", len(every)) as advance:
            return photos, runs.measure_rates(every, advance)

    def errors(
        self, folder: Path, photos: Sequence[Path], phases: "Phases"
    ) -> dict[str, tuple["SettingRow", ...]]:
        """Rows of every command, from the scenes that the runs wrote."""
        from diff4splat.cli.calibration import calibration_errors as errors
        from diff4splat.io.scene_files.scene_file import load_scene

        names = ("scene-3", "scene-4", "scene-6", "fit-hexplane-1", "fit-spacetime-1")
        scenes = [load_scene(folder / name / "scene.safetensors") for name in names]
        moving = [scene for scene in scenes if len(scene.motion.moving_index)]
        count = len(photos) * len(errors.generation_settings())
        rows = {}
        with phases.phase("measure errors", count) as advance:
            rows["generate"] = errors.generation_rows(photos, advance)
        with phases.phase("scenes", 2 * len(scenes) + len(moving)) as advance:
            rows["render"] = errors.render_rows(scenes, advance)
            rows["export html"] = errors.html_rows(scenes, advance)
            rows["bake"] = errors.bake_rows(moving, advance)
        return rows
