"""Columns of the results table: title, meaning, and which direction is better."""

from dataclasses import dataclass
from typing import Literal

from diff4splat.evaluation.protocols.protocol import Task

Table = Literal["images", "hidden", "objects", "camera", "diversity", "videos"]
SYSTEM = "system"
"""Row of the system in stored results."""
TRUTH = "truth"
"""Row of the true videos, with which distributions are compared."""
PSNR_CAP_DB = 100.0
"""Value of identical images: an infinite PSNR would make every mean infinite."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Column:
    """One metric."""

    key: str
    title: str
    better: Literal["higher", "lower", "neither"]
    """``neither`` if the value depends on the clips alone."""
    meaning: str
    tasks: tuple[Task, ...] = ("generation", "reconstruction")
    table: Table = "images"
    """Part of the report that shows it."""

    @property
    def sign(self) -> int:
        """Factor that makes differences above 0 mean better; 0 for ``neither``."""
        return {"higher": 1, "lower": -1, "neither": 0}[self.better]


HIDDEN_REGIONS = {
    "hidden": "pixels with a true depth whose surface the input does not show",
    "disoccluded": "hidden pixels that were behind what is static: the camera has moved",
    "disoccluded_by_motion": "hidden pixels that were behind what moves",
    "outside": "hidden pixels that were out of the frame",
}
"""What the input hides, and the three classes of it."""


def _hidden_columns(region: str, what: str) -> tuple[Column, ...]:
    title = region.replace("_", " ")
    share = Column(
        key=f"{region}_share",
        title=title,
        better="neither",
        table="hidden",
        meaning=f"share of {what}; depends on the clips alone",
    )
    error = Column(
        key=f"{region}_psnr",
        title=f"PSNR {title} [dB]",
        better="higher",
        table="hidden",
        meaning="PSNR over these pixels",
    )
    distance = Column(
        key=f"{region}_perceptual",
        title=f"perceptual {title}",
        better="lower",
        table="hidden",
        meaning="perceptual distance where only these pixels differ from the true image",
    )
    return share, error, distance


COLUMNS = (
    Column(
        key="psnr",
        title="PSNR [dB]",
        better="higher",
        meaning=f"colour of the target images, capped at {PSNR_CAP_DB:g} per image",
    ),
    Column(
        key="covisible_psnr",
        title="PSNR seen [dB]",
        better="higher",
        meaning="PSNR over the pixels whose surface is visible in the input, by ground truth depth",
    ),
    Column(
        key="covisible_share",
        title="seen",
        better="neither",
        meaning="fraction of such pixels in the target images; depends on the clips alone",
    ),
    Column(
        key="ssim",
        title="SSIM",
        better="higher",
        meaning="structural similarity of the target images",
    ),
    Column(
        key="perceptual",
        title="perceptual",
        better="lower",
        meaning="perceptual distance of the target images, by the features named above",
    ),
    Column(
        key="depth_pearson",
        title="depth r",
        better="higher",
        meaning="correlation of rendered and true depth where true depth is known",
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
        meaning="end-point error of tracked points, in units where the median depth of the "
        "first frame is 4",
    ),
    Column(
        key="track_ratio",
        title="EPE / still",
        better="lower",
        meaning="track EPE divided by that of zero motion; undefined for clips without motion",
    ),
    Column(
        key="moving_share",
        title="moving if still",
        better="lower",
        meaning="fraction of moving Gaussians on static clips",
    ),
    Column(
        key="loop_psnr",
        title="loop [dB]",
        better="higher",
        meaning="last against first image of a closed path while time runs, static clips only",
    ),
    Column(
        key="pose_translation",
        title="RPE trans",
        better="lower",
        table="camera",
        meaning="translation error of camera steps estimated from rendered images, scene units",
    ),
    Column(
        key="pose_rotation",
        title="RPE rot [°]",
        better="lower",
        table="camera",
        meaning="rotation error of the same steps",
    ),
    Column(
        key="pose_failed",
        title="RPE failed",
        better="lower",
        table="camera",
        meaning="fraction of steps whose estimation failed",
    ),
    Column(
        key="object_iou",
        title="overlap",
        better="higher",
        table="objects",
        tasks=("generation", "reconstruction", "text"),
        meaning="intersection over union of what moves in the first image with the objects that "
        "are asked to",
    ),
    Column(
        key="object_torn",
        title="torn",
        better="lower",
        table="objects",
        tasks=("generation", "reconstruction", "text"),
        meaning="share of these objects that fall into parts, of those that move",
    ),
    Column(
        key="text_object",
        title="right object",
        better="higher",
        table="objects",
        tasks=("text",),
        meaning="share of captions whose named object moves farthest, where the image shows "
        "several named objects",
    ),
    Column(
        key="diversity",
        title="spread over seeds",
        better="neither",
        table="diversity",
        meaning="RMS difference of colours between two seeds, mean over pairs",
    ),
    Column(
        key="diversity_hidden",
        title="spread, hidden",
        better="neither",
        table="diversity",
        meaning="the same over hidden pixels",
    ),
    Column(
        key="frame_consistency",
        title="consistency",
        better="higher",
        table="videos",
        meaning="mean cosine of the features of every frame with those of the first frame and of "
        "the frame before; 1 for an image that does not change",
    ),
    Column(
        key="clip_score",
        title="CLIP score",
        better="higher",
        table="videos",
        meaning="100 times the cosine of frames and caption",
    ),
    Column(
        key="aesthetic",
        title="aesthetic",
        better="higher",
        table="videos",
        meaning="score of an aesthetic predictor",
    ),
    *(column for item in HIDDEN_REGIONS.items() for column in _hidden_columns(*item)),
    Column(
        key="camera_translation",
        title="path trans",
        better="lower",
        table="camera",
        meaning="translation error of every frame of the path, recovered from its image and the "
        "first one, over the length of the asked translation",
    ),
    Column(
        key="camera_rotation",
        title="path rot [°]",
        better="lower",
        table="camera",
        meaning="rotation error of the same poses",
    ),
    Column(
        key="camera_failed",
        title="path failed",
        better="lower",
        table="camera",
        meaning="fraction of these frames whose pose was not recovered",
    ),
    Column(
        key="pose_matches",
        title="matches",
        better="higher",
        table="camera",
        meaning="points of a rendered image that are found in the next where its depth puts them "
        "(SIFT)",
    ),
    Column(
        key="text_right",
        title="direction right",
        better="higher",
        tasks=("text",),
        meaning="fraction of captions whose direction the named object follows; 0.5 is chance, "
        "and the value of a system that ignores the text",
    ),
    Column(
        key="text_both",
        title="both right",
        better="higher",
        tasks=("text",),
        meaning="fraction of samples correct for both left and right; 0 without using the text",
    ),
    Column(
        key="text_still",
        title="still if asked",
        better="higher",
        tasks=("text",),
        meaning="fraction of static Gaussians if the text requests no motion",
    ),
    Column(
        key="text_free",
        title="direction, free words",
        better="higher",
        tasks=("text",),
        meaning="direction right with sentences that no network was trained on",
    ),
    Column(
        key="text_absent",
        title="still if absent",
        better="higher",
        tasks=("text",),
        meaning="share of samples in which nothing moves if the text names an object that is not "
        "there, or in another colour",
    ),
)
PRIMARY = {"generation": "psnr", "reconstruction": "psnr", "text": "text_right"}
"""Metric that ranks the items from best to worst."""


def columns_of(task: Task) -> tuple[Column, ...]:
    """Columns of a task."""
    return tuple(column for column in COLUMNS if task in column.tasks)


def column_of(key: str) -> Column:
    """The column of that key."""
    return next(column for column in COLUMNS if column.key == key)
