"""``diff4splat prepare``: clips to train on, and whether clips agree with themselves."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal


@dataclass(frozen=True, kw_only=True)
class PrepareSynthetic:
    """Draw procedural worlds into a folder of shards; after a stop, --append goes on."""

    out: Path
    """Folder for the shards, the manifest and a contact sheet."""
    clips: int
    """How many clips."""
    seed: int = 0
    """Worlds of another seed are other worlds."""
    first: int = 0
    """Index of the first world, to continue a series in another folder."""
    split: Literal["training", "held_out"] = "training"
    """Families, textures and motions to draw from."""
    still_share: float = 0.25
    """Share of clips in which only the camera moves."""
    size: int = 128
    """Picture side in pixels."""
    frames: int = 17
    """Frames per clip, 1 + 4 k for training."""
    views: int = 3
    """Cameras per clip; the first is the input."""
    tracks: int = 512
    """Points followed through every clip."""
    workers: int = 1
    """Processes that draw."""
    append: bool = False
    """Add to a folder that has clips; those it has already are not drawn again."""

    def run(self) -> None:
        """Draw, write, and show a contact sheet."""
        from diff4splat.cli.console import ConsolePhases, note
        from diff4splat.data_prep.clip_sheet import write_clip_sheet
        from diff4splat.data_prep.synthetic.drawing.settings import DrawSettings
        from diff4splat.data_prep.synthetic.worlds import WorldRecipe
        from diff4splat.data_prep.writing import WorldJob, write_worlds

        recipe = WorldRecipe(
            seed=self.seed,
            split=self.split,
            still_share=self.still_share,
            frames=self.frames,
            size_px=(self.size, self.size),
            views=self.views,
        )
        job = WorldJob(
            folder=self.out,
            clips=self.clips,
            recipe=recipe,
            first=self.first,
            draw=DrawSettings(tracks=self.tracks),
            workers=self.workers,
        )
        phases = ConsolePhases()
        drawn = write_worlds(job, phases, self.append)
        write_clip_sheet(self.out, self.out / "clips.png")
        seconds = phases.seconds["draw clips"]
        note(f"wrote {drawn} clips to {self.out} in {seconds:.0f} s; look at clips.png there")


@dataclass(frozen=True, kw_only=True)
class PrepareCheck:
    """Whether depth, cameras, flow and tracks of every clip agree; any folder of shards."""

    folder: Path
    """Folder of shards."""
    most: int | None = None
    """Look at so many clips, spread evenly; if left out, at all."""

    def run(self) -> None:
        """Print the worst disagreement of each kind.

        Raises:
            InputError: a clip disagrees by more than exact truth may.
        """
        from diff4splat.cli.console import ConsolePhases
        from diff4splat.data_prep.checking import check_folder

        print(check_folder(self.folder, self.most, ConsolePhases()))
