"""Where clips come from: procedural worlds without end, or folders of shards.

A source answers any index from 0; training and evaluation never share a clip: worlds of evaluation
have indices from EVALUATION_START on, and a folder keeps its last clips back for it.
"""

from dataclasses import replace
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

    def __init__(self, settings: SourceSettings, data: DataSettings, seed: int) -> None:
        self.folder = Path(settings.folder)
        views = min(settings.views or data.views, data.views)
        self.views, self.selection = views, Selection(commercial_only=data.commercial_only)
        self.kept: dict[int, Clip] | None = {} if data.in_memory else None
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
        chosen = self.clips.positions(self.selection)
        split = split_by_motion([self.clips.entries[place].is_static for place in chosen])
        return {kind: [chosen[place] for place in places] for kind, places in split.items()}


def open_source(settings: SourceSettings, data: DataSettings, seed: int) -> EndlessClips:
    """The source that the settings name.

    Raises:
        InputError, FileFormatError: the folder is not one of shards, or lacks a kind of clip.
    """
    if settings.kind == "worlds":
        return world_clips(settings, data, seed)
    # A missing folder stops the run now, not every sample later.
    _require_clips(ClipFolder(settings.folder), settings, data.commercial_only)
    return FolderClips(settings, data, seed)


def open_mixture(data: DataSettings, seed: int) -> tuple[list[EndlessClips | None], DataSettings]:
    """The sources of a stage, and the settings that they fit.

    In a mixture a folder of static clips alone gives static ones, one of moving clips alone gives
    moving ones, and one without clips of the kind that the stage asks for has weight 0.

    Raises:
        InputError, FileFormatError: as ``open_source``, or no folder has a clip for the stage.
    """
    if len(data.sources) > 1:
        data = replace(data, sources=tuple(_fitting(source, data) for source in data.sources))
    opened = [open_source(one, data, seed) if one.weight else None for one in data.sources]
    return opened, data


def unused_sources(data: DataSettings) -> list[str]:
    """What to say of the folders of a mixture that give no clip, though they have a weight."""
    if len(data.sources) < 2:
        return []
    return [
        f"{source.folder} gives no clip: expected {_expected(source)}, got others alone; "
        "change its still_share"
        for source in data.sources
        if source.weight and not _fitting(source, data).weight
    ]


def _expected(source: SourceSettings) -> str:
    share = source.still_share
    return " or ".join(["static clips"] * (share > 0) + ["moving clips"] * (share < 1))


def _fitting(settings: SourceSettings, data: DataSettings) -> SourceSettings:
    """The settings with the share of static clips that the folder can give, or weight 0."""
    if settings.kind != "shards" or not settings.weight:
        return settings
    clips, commercial = ClipFolder(settings.folder), data.commercial_only
    stills = len(clips.positions(Selection(is_static=True, commercial_only=commercial)))
    moving = len(clips.positions(Selection(is_static=False, commercial_only=commercial)))
    share = settings.still_share
    if not (stills and share > 0) and not (moving and share < 1):
        return replace(settings, weight=0.0)
    if not stills or not moving:
        return replace(settings, still_share=float(stills > 0))
    return settings


def _require_clips(clips: ClipFolder, settings: SourceSettings, commercial: bool) -> None:
    """The folder has clips of every kind that samples will ask for."""
    usable = len(clips.positions(Selection(commercial_only=commercial)))
    stills = len(clips.positions(Selection(is_static=True, commercial_only=commercial)))
    share = settings.still_share
    needed = {"still": (stills, share > 0, 0), "moving": (usable - stills, share < 1, 1)}
    if len(clips) and not usable:
        raise InputError(
            f"{settings.folder}: expected clips for commercial use, got none of {len(clips)}; "
            "leave the folder out or set data.commercial_only=false"
        )
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
