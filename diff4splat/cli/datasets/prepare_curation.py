"""``diff4splat prepare align``, ``curate`` and ``captions``: clips of data sets before training."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from diff4splat.cli.options.constraints import (
    InputPath,
    Number,
    OutFolder,
    OutputFile,
    OutputFolder,
)

Shards = Annotated[Path, tyro.conf.Positional, InputPath(what="a folder of shards", file=False)]


@dataclass(frozen=True, kw_only=True)
class PreparePoses:
    """Estimate camera poses of a video by matching features; lengths have no unit."""

    video: Annotated[Path, tyro.conf.Positional, InputPath(what="a video", folder=False)]
    """Up to 300 frames of a mostly static scene, filmed by a camera that moves."""
    out: Annotated[Path, OutputFile(suffixes=(".json",)), tyro.conf.arg(aliases=("-o",))]
    """Pose file; NAME.json beside NAME.mp4 makes it a capture for prepare import."""
    fov: Annotated[float, Number(least=10, most=150)] = 60.0
    """Horizontal field of view in degrees; wrong values bend the path."""

    def run(self) -> None:
        """Follow the camera and write the poses."""
        from diff4splat.cli.common.console import ConsolePhases, note
        from diff4splat.data_prep.alignment.video_to_path import write_video_poses

        with ConsolePhases().phase("estimate poses") as advance:
            frames = write_video_poses(self.video, self.out, self.fov)
            advance()
        note(f"wrote {frames} poses to {self.out}")


@dataclass(frozen=True, kw_only=True)
class PrepareAlign:
    """Fit relative disparity to metric depth; clips that fail a gate are listed, not written."""

    clips: Shards
    """Folder of shards."""
    out: OutFolder
    """Folder for the aligned clips; existing clips are kept."""
    reference: Literal["depth", "tracks", "stereo", "triangulation", "megasam"]
    """What to fit to: depth or tracks of the clip, its second view, matched points, or MegaSaM."""
    disparity: Annotated[Path | None, InputPath(what="disparity files", file=False)] = None
    """Folder of Video Depth Anything's ID_depths.npz. Default: disparity from optical flow."""
    megasam: Annotated[Path | None, InputPath(what="MegaSaM's outputs", file=False)] = None
    """Folder of MegaSaM's ID_sgd_cvd_hr.npz."""
    normaliser: Annotated[float | None, Number(above=0)] = None
    """What MegaSaM divided its lengths by. Default: from the metric poses of each clip."""
    method: Literal["disparity", "paper_depth_space", "least_squares"] = "disparity"
    """RANSAC and reweighting in disparity; the paper's Algorithm 1 in depth; least squares."""

    def check(self) -> None:
        """Require MegaSaM's folder where it is the reference."""
        from diff4splat.errors import ConfigError

        if self.reference == "megasam" and self.megasam is None:
            raise ConfigError("--reference megasam: expected --megasam FOLDER, got none; name it")

    def run(self) -> None:
        """Align, write, and report what became of the clips."""
        from diff4splat.cli.common.console import ConsolePhases, note
        from diff4splat.data_prep.alignment.align_clip import AlignmentSettings
        from diff4splat.data_prep.alignment.align_folder import (
            AlignJob,
            align_folder,
            alignment_summary,
        )

        job = AlignJob(
            clips=self.clips,
            folder=self.out,
            reference=self.reference,
            disparity=self.disparity,
            megasam=self.megasam,
            normaliser=self.normaliser,
            settings=AlignmentSettings(method=self.method),
        )
        text = alignment_summary(align_folder(job, ConsolePhases()))
        note(f"{text}; see alignment.csv in {self.out}")


@dataclass(frozen=True, kw_only=True)
class PrepareCurate:
    """Score clips, select by thresholds, report. Nothing is deleted; stopped runs continue."""

    clips: Annotated[
        tuple[Path, ...], tyro.conf.Positional, InputPath(what="a folder of shards", file=False)
    ]
    """Folders of shards, one or several."""
    out: OutFolder
    """Folder for scores, decisions, the list of selected clips and report.html."""
    thresholds: Annotated[Path | None, InputPath(what="thresholds", folder=False)] = None
    """Your copy of thresholds.toml. Default: the one that every run writes to --out."""
    quality: str = ""
    """Your quality model as module:function; takes three frames, returns a number."""
    shards: Annotated[Path | None, OutputFolder()] = None
    """Also copy the selected clips into this folder of shards."""
    complete: bool = False
    """With --shards: add estimated motion masks, and tracks chained from true flow and depth."""
    parquet: bool = False
    """Also write manifest.parquet, one row per clip with scores and reasons (needs pyarrow)."""
    workers: Annotated[int, Number(least=1, most=256)] = 1
    """Number of scoring processes."""

    def check(self) -> None:
        """Read the thresholds before anything is scored."""
        from diff4splat.data_prep.curation.thresholds import read_thresholds
        from diff4splat.errors import ConfigError

        read_thresholds(self.thresholds)
        if self.complete and self.shards is None:
            raise ConfigError("--complete: expected --shards FOLDER, got none; name the folder")

    def run(self) -> None:
        """Score, decide, write tables and report."""
        from diff4splat.cli.common.console import ConsolePhases, note
        from diff4splat.data_prep.curation.curate import CurationJob, curate
        from diff4splat.data_prep.curation.hooks import Hooks
        from diff4splat.data_prep.curation.parquet_manifest import require_parquet, write_parquet
        from diff4splat.data_prep.curation.report.page import write_report
        from diff4splat.data_prep.curation.score_folders import ScoringJob
        from diff4splat.data_prep.curation.selection import write_selection
        from diff4splat.data_prep.curation.thresholds import read_thresholds

        phases, thresholds = ConsolePhases(), read_thresholds(self.thresholds)
        if self.parquet:
            require_parquet()
        scoring = ScoringJob(
            folders=self.clips,
            out=self.out,
            hooks=Hooks(quality=self.quality),
            workers=self.workers,
        )
        decisions = curate(CurationJob(scoring=scoring, thresholds=thresholds), phases)
        report = write_report(decisions, thresholds, self.clips, self.out, phases)
        if self.parquet:
            write_parquet(decisions, self.out)
        if self.shards is not None:
            write_selection(decisions, self.clips, self.shards, phases, self.complete)
        selected = sum(each.is_selected for each in decisions)
        note(f"selected {selected} of {len(decisions)} clips; open {report}")


@dataclass(frozen=True, kw_only=True)
class PrepareCaptions:
    """Copy clips with captions from files or from your captioning model; pixels stay the same."""

    clips: Shards
    """Folder of shards."""
    out: OutFolder
    """Folder for the clips with captions; existing clips are kept."""
    captions: Annotated[Path | None, InputPath(what="captions")] = None
    """Captions by clip or scene: .json, .jsonl, .csv, .tsv, or a folder of .txt files."""
    captioner: str = ""
    """Your model as module:function, for clips without one; takes a clip, returns text."""
    replace: bool = False
    """Replace captions that clips have."""

    def check(self) -> None:
        """Require a source of captions."""
        from diff4splat.errors import ConfigError

        if self.captions is None and not self.captioner:
            raise ConfigError(
                "prepare captions: expected --captions or --captioner, got neither; name one"
            )

    def run(self) -> None:
        """Find captions and write the clips."""
        from diff4splat.cli.common.console import ConsolePhases, note
        from diff4splat.data_prep.curation.captions.captioning import (
            CaptionJob,
            caption_summary,
            write_captions,
        )

        job = CaptionJob(
            clips=self.clips,
            folder=self.out,
            side_car=self.captions,
            captioner=self.captioner,
            replace_present=self.replace,
        )
        note(f"{caption_summary(write_captions(job, ConsolePhases()))}; see captions.csv")
