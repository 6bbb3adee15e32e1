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
    against_share: float = 0.0
    """Share of things that go against what their place and facing suggest: only text tells then."""
    frozen_share: float = 0.0
    """Share of the other clips in which what could move stands all the same."""
    size: int = 128
    """Picture side in pixels."""
    frames: int = 17
    """Frames per clip, 1 + 4 k for training."""
    fps: float = 8.0
    """Frames per second; 3 frames at 1 are the moments that a motion branch needs."""
    views: int = 3
    """Cameras per clip; the first is the input."""
    rig: bool = False
    """Cameras stand all around, for per-scene fitting; the last two are good to hold out."""
    motions: tuple[str, ...] = ()
    """Only worlds with these motions, such as slides or bends; if left out, any."""
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
        from diff4splat.data_prep.synthetic.renderer.settings import DrawSettings
        from diff4splat.data_prep.synthetic.worlds import WorldRecipe
        from diff4splat.data_prep.writing import WorldJob, write_worlds

        recipe = WorldRecipe(
            seed=self.seed,
            split=self.split,
            still_share=self.still_share,
            against_share=self.against_share,
            frozen_share=self.frozen_share,
            frames=self.frames,
            fps=self.fps,
            size_px=(self.size, self.size),
            views=self.views,
            rig=self.rig,
            motions=self.motions or None,
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
class PrepareLatents:
    """Encode clips and their drafts once, so that the video model need not read pictures."""

    clips: Path
    """Folder of shards."""
    out: Path
    """Folder for the latents; files that are there already are left as they are."""
    model: str = "small"
    """Model (folder or name) that encodes."""
    config: str = "small"
    """Recipe whose video_diffusion stage sets the frames and their size."""
    mirror: bool = True
    """Each clip also with left and right exchanged, in pictures and in words."""

    def run(self) -> None:
        """Encode and write."""
        from diff4splat.cli.console import ConsolePhases, note
        from diff4splat.cli.installation import speck
        from diff4splat.cli.renderer import prepare_renderer
        from diff4splat.configs.recipes import find_recipe
        from diff4splat.models.hub.model import load_model
        from diff4splat.training.latents.encode import EncodingJob, encode_clips

        phases = ConsolePhases()
        prepare_renderer(speck("cpu"), phases)
        job = EncodingJob(
            model=load_model(self.model),
            data=find_recipe(self.config).stage_of_kind("video_diffusion").data,
            clips=self.clips,
            folder=self.out,
            mirror=self.mirror,
        )
        note(f"wrote {encode_clips(job, phases)} encoded clips to {self.out}")


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
