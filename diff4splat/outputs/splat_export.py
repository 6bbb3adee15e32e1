"""Scenes at one time, or a row of times, for other programs; compared before they appear."""

from collections.abc import Callable, Sequence
from pathlib import Path

from diff4splat.io.atomic import atomic_path
from diff4splat.io.ply.ply_file import read_ply, write_ply_sequence
from diff4splat.io.splats.formats import SPLAT_FORMATS
from diff4splat.io.splats.second_reader import NAME, second_reader
from diff4splat.outputs.export_check import ExportCheck, check_states, require_floor
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.scene import Scene

READER = "diff4splat"
CHECKED_FILES = 3
"""Of a sequence."""
_ADVICE = "choose .ply or .glb, which round nothing"


def export_moment(
    scene: Scene, time_s: float, file: Path, spz_version: int = 3
) -> tuple[ExportCheck, ...]:
    """Write the state at ``time_s`` by the ending of ``file``; returns what its readers see.

    The file is read again, by gsply, too, where it is installed and knows the format.

    Raises:
        InputError: a value is NaN, infinite or beyond float32.
        MissingExtraError: SPZ 4 without zstandard.
        OutputError: the file shows something else than the scene, or cannot be written.
    """
    form, state = SPLAT_FORMATS[file.suffix.lower()], scene.state_at(time_s)
    readers = {READER: lambda path: form.read(path).gaussians}
    if (second := second_reader(file)) is not None:
        readers[NAME] = second
    with atomic_path(file) as temporary:
        form.write(state, temporary, time_s, spz_version)
        checks = tuple(
            check_states(scene, _always(read(temporary)), [time_s], name, form.least_psnr_db)
            for name, read in readers.items()
        )
        require_floor(checks, file, _ADVICE)
    return checks


def export_sequence(
    scene: Scene, folder: Path, times_s: Sequence[float], advance: Callable[[], None]
) -> tuple[ExportCheck, ...]:
    """Write numbered PLY files; some are read again and compared before any appears.

    Raises:
        InputError: no times, or a state that is not finite.
        OutputError: a file shows something else than the scene, or cannot be written.
    """
    chosen = sorted({0, len(times_s) // 2, len(times_s) - 1})[:CHECKED_FILES]
    floor_db = SPLAT_FORMATS[".ply"].least_psnr_db
    checks: list[ExportCheck] = []

    def compare(files: Sequence[Path]) -> None:
        by_time = {times_s[index]: files[index] for index in chosen}
        checks.append(
            check_states(scene, lambda t: read_ply(by_time[t]), by_time, READER, floor_db)
        )
        require_floor(checks, folder, _ADVICE)

    write_ply_sequence(scene, folder, times_s, advance, compare)
    return tuple(checks)


def _always(gaussians: Gaussians) -> Callable[[float], Gaussians]:
    return lambda time_s: gaussians
