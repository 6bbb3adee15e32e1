"""Where clips come from: procedural worlds without end, or folders of shards.

A source answers any index from 0; training and evaluation never share a clip: worlds of evaluation
have indices from EVALUATION_START on, and a folder keeps its last clips back for it.
"""

from functools import cached_property
from pathlib import Path
from typing import Protocol, runtime_checkable

from diff4splat.data.clip import Clip
from diff4splat.data.clip_folder import ClipFolder, Selection
from diff4splat.data.clip_part import ClipPart
from diff4splat.data_prep.synthetic.renderer.clips import draw_clip
from diff4splat.data_prep.synthetic.renderer.settings import DrawSettings
from diff4splat.data_prep.synthetic.worlds import FPS, WorldRecipe, make_world
from diff4splat.errors import InputError
from diff4splat.training.batches.epoch_shuffle import (
    IndicesByMotion,
    ShuffledIndices,
    split_by_motion,
)
from diff4splat.training.recipe.data import DataSettings, SourceSettings


@runtime_checkable
class EndlessClips(Protocol):
    """Clips by index, without end."""

    def clip(self, index: int) -> Clip:
        """The clip of a sample; equal indices give equal clips.

        Raises:
            FileFormatError, InputError: this clip cannot be had; others may.
        """
        ...


class WorldClips:
    """Procedural worlds, drawn when they are asked for; every index is another world."""

    def __init__(self, recipe: WorldRecipe, draw: DrawSettings) -> None:
        self.recipe = recipe
        self.draw = draw

    def clip(self, index: int) -> Clip:
        """World number ``index``."""
        return draw_clip(make_world(self.recipe, index), self.draw)


class FolderClips:
    """A folder of shards, shuffled anew in every epoch."""

    def __init__(
        self, settings: SourceSettings, views: int, seed: int, in_memory: bool = False
    ) -> None:
        self.folder = Path(settings.folder)
        self.views = views
        self.kept: dict[int, Clip] | None = {} if in_memory else None
        self.order = ShuffledIndices(settings.still_share, seed)

    @cached_property
    def clips(self) -> ClipFolder:
        """Opened when first needed, so that every worker process opens its own."""
        return ClipFolder(self.folder)

    def clip(self, index: int) -> Clip:
        """Still and moving clips in the asked share, each shuffled on its own."""
        position = self.order.place(index, self._places)
        if self.kept is None:
            return self._read(position)
        if position not in self.kept:
            self.kept[position] = self._read(position)
        return self.kept[position]

    def _read(self, position: int) -> Clip:
        """Without flow, and no more views than samples have."""
        present = self.clips.entries[position].views
        part = ClipPart(views=tuple(range(min(self.views, present))), flow=False)
        return self.clips.clip(position, part)

    @cached_property
    def _places(self) -> IndicesByMotion:
        return split_by_motion([entry.is_static for entry in self.clips.entries])


def open_source(settings: SourceSettings, data: DataSettings, seed: int) -> EndlessClips:
    """The source that the settings name.

    Raises:
        InputError, FileFormatError: the folder is not one of shards, or lacks a kind of clip.
    """
    if settings.kind == "worlds":
        return world_clips(settings, data, seed)
    # A missing folder stops the run now, not every sample later.
    _require_clips(ClipFolder(settings.folder), settings)
    return FolderClips(settings, data.views, seed, data.in_memory)


def _require_clips(clips: ClipFolder, settings: SourceSettings) -> None:
    """The folder has clips of every kind that samples will ask for."""
    stills = len(clips.positions(Selection(is_static=True)))
    share = settings.still_share
    needed = {"still": (stills, share > 0, 0), "moving": (len(clips) - stills, share < 1, 1)}
    if not len(clips):
        raise InputError(f"{settings.folder}: expected clips, got none; prepare some")
    for kind, (count, wanted, other) in needed.items():
        if wanted and not count:
            raise InputError(
                f"{settings.folder}: expected {kind} clips for still_share {share:g}, got none; "
                f"prepare some or set still_share to {other}"
            )


def world_clips(settings: SourceSettings, data: DataSettings, seed: int) -> "WorldClips":
    """Worlds at the size of the samples."""
    recipe = WorldRecipe(
        seed=seed,
        split=settings.split,
        still_share=settings.still_share,
        frames=data.clip_frames,
        fps=FPS / data.keyframe_spacing,
        size_px=data.size_px,
        views=data.views,
    )
    return WorldClips(recipe, DrawSettings(tracks=data.tracks, flow=False))
