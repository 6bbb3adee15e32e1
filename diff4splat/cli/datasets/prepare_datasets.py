"""``diff4splat prepare doctor`` and ``import``: data sets that others made."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from diff4splat.cli.options.constraints import InputPath, Number, OutFile, OutFolder

DatasetName = Literal[
    "tartanair",
    "matrixcity",
    "point_odyssey",
    "dynamic_replica",
    "spring",
    "vkitti2",
    "multicam_video",
    "realestate10k",
    "stereo4d",
    "capture",
]


@dataclass(frozen=True, kw_only=True)
class PrepareDoctor:
    """Prove that a copy of a data set is read as meant: a table, a figure, likely causes."""

    path: Annotated[Path, tyro.conf.Positional, InputPath(what="a copy of a data set")]
    """Folder of the data set, or of a part of it."""
    dataset: DatasetName
    """Which data set it is; capture is any format that fit reads, or a video beside its poses."""
    clips: Annotated[int, Number(least=1, most=1000)] = 3
    """Number of sequences to examine, spread evenly."""
    frames: Annotated[int, Number(least=2, most=200)] = 9
    """Frames per clip."""
    out: OutFile = Path("doctor.png")
    """Figure of the worst clip."""

    def run(self) -> None:
        """Print the table, write the picture.

        Raises:
            InputError: something is wrong, or nothing could be read.
        """
        from diff4splat.cli.common.console import ConsolePhases, note
        from diff4splat.data_prep.doctor.examination import DoctorJob, examine, table, verdict
        from diff4splat.data_prep.doctor.overview import draw_examined
        from diff4splat.errors import InputError
        from diff4splat.io.photos.images import write_png

        job = DoctorJob(root=self.path, dataset=self.dataset, clips=self.clips, frames=self.frames)
        findings = examine(job, ConsolePhases())
        print(table(findings))
        if findings.examined:
            write_png(draw_examined(findings.worst, verdict(findings)), self.out)
            note(f"wrote {self.out}: the worst clip, read as it was")
        if not findings.is_sound:
            raise InputError(f"{self.path}: {verdict(findings)}")


@dataclass(frozen=True, kw_only=True)
class PrepareImport:
    """Turn a copy of a data set into a folder of shards. Unusable clips become rows of a report."""

    path: Annotated[Path, tyro.conf.Positional, InputPath(what="a copy of a data set")]
    """Folder of the data set, or of a part of it."""
    dataset: DatasetName
    """Which data set it is; capture is any format that fit reads, or a video beside its poses."""
    out: OutFolder
    """Folder for the shards, the manifest, report.csv and a contact sheet."""
    frames: Annotated[int, Number(least=2, most=10_000)] = 81
    """Frames per clip; shorter sequences give one clip each."""
    step: Annotated[int | None, Number(least=1)] = None
    """Frames from the start of a clip to that of the next. Default: as many as a clip has."""
    max_side: Annotated[int | None, Number(least=8, most=16384)] = 512
    """Reduce images until their longer side has this many pixels."""
    tracks: Annotated[int, Number(least=1)] = 2048
    """Largest number of tracked points per clip."""
    views: Annotated[int, Number(least=1, most=100)] = 4
    """Largest number of cameras per clip."""
    sequences: Annotated[int | None, Number(least=1)] = None
    """Read the first N sequences only."""
    images: Literal["png", "jpeg", "mp4"] = "png"
    """PNG without loss, JPEG, which is read fastest, or MP4, which is smallest."""
    depth: Literal["pxr24", "half", "half_plain", "float"] = "pxr24"
    """Relative error of depth: 1.5e-5, 4.9e-4 (packed, or plain and read fastest), or none."""
    append: bool = False
    """Add to an existing folder; existing clips are kept."""
    task: Annotated[int, Number(least=0)] = 0
    """Which of --tasks parts to import, from 0; each part needs another folder."""
    tasks: Annotated[int, Number(least=1, most=1_000_000)] = 1
    """Number of parts that the sequences are divided into, to import on several machines."""

    def check(self) -> None:
        """Require a task that exists."""
        Number(least=0, most=self.tasks - 1).check("--task", self.task)

    def run(self) -> None:
        """Read, write, and say what became of the clips."""
        from diff4splat.cli.common.console import ConsolePhases, note
        from diff4splat.data.codecs.encode import Coding
        from diff4splat.data_prep.clip_sheet import write_clip_sheet
        from diff4splat.data_prep.datasets.common.windows import WindowOptions
        from diff4splat.data_prep.datasets.importing import ImportJob, import_dataset, summary

        windows = WindowOptions(
            frames=self.frames,
            step=self.step,
            max_side_px=self.max_side,
            most_tracks=self.tracks,
            most_views=self.views,
        )
        job = ImportJob(
            root=self.path,
            dataset=self.dataset,
            folder=self.out,
            windows=windows,
            coding=Coding(images=self.images, depth=self.depth),
            most_sequences=self.sequences,
            append=self.append,
            task=self.task,
            tasks=self.tasks,
        )
        rows = import_dataset(job, ConsolePhases())
        text = summary(rows)
        write_clip_sheet(self.out, self.out / "clips.png")
        note(f"{text}; look at clips.png and report.csv in {self.out}")
