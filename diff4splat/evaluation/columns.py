"""The columns of the table: what each measure is called, and which way is better."""

from dataclasses import dataclass
from typing import Literal

from diff4splat.evaluation.protocol import Task

SYSTEM = "system"
"""Row of the system under test in stored results."""
PSNR_CAP_DB = 100.0
"""Equal pictures count as this: an infinite item would swallow every mean."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Column:
    """One measure."""

    key: str
    title: str
    better: Literal["higher", "lower", "neither"]
    """Neither: it says something of the clips, not of the rows."""
    meaning: str
    tasks: tuple[Task, ...] = ("generation", "reconstruction")

    @property
    def sign(self) -> int:
        """Times a difference, above 0 means better; 0 where nothing is."""
        return {"higher": 1, "lower": -1, "neither": 0}[self.better]


COLUMNS = (
    Column(
        key="psnr",
        title="PSNR [dB]",
        better="higher",
        meaning=f"colour of the judged pictures, capped at {PSNR_CAP_DB:g} per picture",
    ),
    Column(
        key="covisible_psnr",
        title="PSNR seen [dB]",
        better="higher",
        meaning="PSNR over the pixels whose surface the input shows, as true depth tells",
    ),
    Column(
        key="covisible_share",
        title="seen",
        better="neither",
        meaning="share of such pixels in the judged pictures; it depends on the clips alone",
    ),
    Column(key="ssim", title="SSIM", better="higher", meaning="structure of the judged pictures"),
    Column(
        key="perceptual",
        title="perceptual",
        better="lower",
        meaning="perceptual distance of the judged pictures, by the features named above",
    ),
    Column(
        key="depth_pearson",
        title="depth r",
        better="higher",
        meaning="correlation of rendered and true depth where the truth has one",
    ),
    Column(
        key="depth_absrel",
        title="depth AbsRel",
        better="lower",
        meaning="mean of |depth − truth| / truth, without fitting a scale",
    ),
    Column(
        key="track_error",
        title="track EPE",
        better="lower",
        meaning="distance from where followed points are truly, in units of which the median "
        "depth of the first frame is 4",
    ),
    Column(
        key="track_ratio",
        title="EPE / still",
        better="lower",
        meaning="track EPE over that of standing still; clips without motion have none",
    ),
    Column(
        key="moving_share",
        title="moving if still",
        better="lower",
        meaning="share of Gaussians that move on clips in which nothing does",
    ),
    Column(
        key="loop_psnr",
        title="loop [dB]",
        better="higher",
        meaning="last against first picture of a closed path while time runs, still clips only",
    ),
    Column(
        key="pose_translation",
        title="RPE trans",
        better="lower",
        meaning="error of the camera's steps as recovered from rendered pictures, scene units",
    ),
    Column(
        key="pose_rotation", title="RPE rot [°]", better="lower", meaning="the same for its turns"
    ),
    Column(
        key="pose_failed",
        title="RPE failed",
        better="lower",
        meaning="share of steps that could not be recovered",
    ),
    Column(
        key="text_right",
        title="direction right",
        better="higher",
        tasks=("text",),
        meaning="share of captions whose direction the named object takes; 0.5 is chance, and "
        "what ignoring the text gets",
    ),
    Column(
        key="text_both",
        title="both right",
        better="higher",
        tasks=("text",),
        meaning="share of cases right for left and for right; ignoring the text gets 0",
    ),
    Column(
        key="text_still",
        title="still if asked",
        better="higher",
        tasks=("text",),
        meaning="share of Gaussians that stand still when nothing is to move",
    ),
)
PRIMARY = {"generation": "psnr", "reconstruction": "psnr", "text": "text_right"}
"""Decides which items are called best and worst."""


def columns_of(task: Task) -> tuple[Column, ...]:
    """The columns that a task fills."""
    return tuple(column for column in COLUMNS if task in column.tasks)


def column_of(key: str) -> Column:
    """The column of that key."""
    return next(column for column in COLUMNS if column.key == key)
