"""Which clips a stage reads, and what one sample looks like."""

import math
from dataclasses import dataclass
from typing import Literal

from diff4splat.models.config.networks import TIME_STRIDE
from diff4splat.training.recipe.checks import require

Unit = Literal["median_depth", "metre", "known"]


@dataclass(frozen=True, slots=True, kw_only=True)
class SourceSettings:
    """One source of clips in the mixture."""

    kind: Literal["worlds", "shards", "latents"] = "worlds"
    """Rendered during training, shards of clips, or encoded latents (video diffusion only)."""
    folder: str = ""
    """Folder of the shards or latents."""
    split: Literal["training", "held_out"] = "training"
    still_share: float = 0.25
    """Share of clips in which nothing moves."""
    weight: float = 1.0
    depth_loss: Literal["true", "always", "never"] = "true"
    """``true`` leaves out depth whose scale was only assumed (``pseudo``)."""
    motion_loss: Literal["true", "never"] = "true"
    """``never`` leaves out tracks and masks of moving clips. Stage ``object_mask``: requests."""
    views: int = 0
    """Cameras that are read of each clip, such as 1 for monocular use; 0 reads ``data.views``."""
    unit: Literal["", "median_depth", "metre", "known"] = ""
    """Unit of length of these clips; empty is ``data.unit``."""

    def __post_init__(self) -> None:
        require(0 <= self.still_share <= 1, "source.still_share", "0 to 1", self.still_share)
        require(0 <= self.weight < math.inf, "source.weight", "at least 0", self.weight)
        require(self.views >= 0, "source.views", "at least 0", self.views)
        named = self.kind == "worlds" or self.folder != ""
        require(named, "source.folder", "the folder of the shards or latents", "none")


@dataclass(frozen=True, slots=True, kw_only=True)
class DataSettings:
    """What one sample looks like."""

    sources: tuple[SourceSettings, ...] = (SourceSettings(),)
    size_px: tuple[int, int] = (128, 128)
    frames: int = 17
    """Frames of the input video."""
    input_stride: int = 1
    """Clip frames per input frame; frames between input frames are targets at unseen times."""
    augment: bool = False
    """Swapped input views, mirrored and time-reversed clips; only for stages without text."""
    crop_px: tuple[int, int] = (0, 0)
    """Random crop (height, width) of images of ``size_px``; 0 takes the whole image."""
    view_sides_px: tuple[int, ...] = ()
    """Sides, drawn from at each step. Stage ``monocular_depth``: random views (window, zoom, roll,
    noise) of every image. Stage ``motion_diffusion``: widths to which images are reduced and
    enlarged again. Stage ``object_mask``: the same, of square images."""
    photographs: str = ""
    """Stage ``monocular_depth``: folder of photographs without depth, one per sample and step."""
    cutouts: str = ""
    """Stage ``monocular_depth``: folder of images with transparency, shown in some images."""
    views: int = 3
    """Cameras per clip; the first is the input."""
    target_frames: int = 4
    """Supervised (view, time) pairs per sample and step."""
    tracks: int = 512
    """Tracked points per clip."""
    supervise_motion: bool = True
    """False takes all targets of moving clips from their first frame, for static stages."""
    unit: Unit = "median_depth"
    """Length 1 of a sample: a quarter of the clip's median depth, or a metre, and clips without
    metric scale are skipped and counted; ``known`` is a metre where the clip has metric scale, and
    a quarter of the median depth elsewhere."""
    fps: float = 0.0
    """Frame rate that faster clips are thinned to; 0 takes every frame."""
    commercial_only: bool = False
    """Only clips of shards whose licence is known to allow commercial use."""
    keyframes_only: bool = False
    """Clips hold only the first frame and the last frame of each latent frame, which render
    faster; the motion network needs no other."""
    keyframe_stride: int = 1
    """Input frames from one keyframe to the next; tracked points start at keyframes."""
    other_object_share: float = 0.0
    """Stage ``motion_diffusion``: share of samples that ask for another named object of the first
    image, with a displacement to match."""
    absent_object_share: float = 0.0
    """Stage ``motion_diffusion``: share of samples that ask for an object that is not there, or has
    another colour; then nothing moves."""
    single_event_share: float = 0.0
    """Stage ``motion_diffusion``: share of samples with one event of the clip alone: its words, and
    what its object does in the clip."""
    workers: int = 1
    """Worker processes; 0 prepares samples in the training process."""
    in_memory: bool = False
    """Decode each clip of a shard once and keep it in memory, in every worker process."""
    min_valid_depth: float = 0.01
    """Least share of pixels with depth in the input view; other clips are skipped and counted
    (MoVieS)."""

    def __post_init__(self) -> None:
        weight = sum(source.weight for source in self.sources)
        require(weight > 0, "data.sources", "some with a weight above 0", f"{len(self.sources)}")
        for name in ("frames", "input_stride", "keyframe_stride", "views", "target_frames"):
            value = getattr(self, name)
            require(value >= 1, f"data.{name}", "at least 1", value)
        for name in ("tracks", "workers"):
            value = getattr(self, name)
            require(value >= 0, f"data.{name}", "at least 0", value)
        require(min(self.size_px) >= 8, "data.size_px", "sides of at least 8", self.size_px)
        cuts = zip(self.crop_px, self.size_px, strict=True)
        fits = max(self.crop_px) == 0 or all(0 < part <= whole for part, whole in cuts)
        require(fits, "data.crop_px", "0, or sides that size_px has room for", self.crop_px)
        multiples = all(side > 0 and side % 16 == 0 for side in self.view_sides_px)
        require(multiples, "data.view_sides_px", "multiples of 16", self.view_sides_px)
        require(0 <= self.fps < math.inf, "data.fps", "at least 0", self.fps)
        share = self.min_valid_depth
        require(0 <= share <= 1, "data.min_valid_depth", "0 to 1", share)
        valid = min(self.request_shares) >= 0 and sum(self.request_shares) <= 1
        require(
            valid,
            "data.absent_object_share, data.other_object_share and data.single_event_share",
            "0 to 1 together",
            self.request_shares,
        )

    @property
    def request_shares(self) -> tuple[float, float, float]:
        """Of samples that ask for an absent object, another one, and one event of the clip."""
        return self.absent_object_share, self.other_object_share, self.single_event_share

    @property
    def clip_frames(self) -> int:
        """Frames of a clip from the first input frame to the last."""
        return 1 + (self.frames - 1) * self.input_stride // self.keyframe_spacing

    @property
    def keyframe_spacing(self) -> int:
        """Frames of the full clip between two frames that samples hold."""
        return TIME_STRIDE * self.input_stride if self.keyframes_only else 1
