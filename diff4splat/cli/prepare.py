"""``diff4splat prepare``: make training clips, encode them, and check their consistency."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal


@dataclass(frozen=True, kw_only=True)
class PrepareSynthetic:
    """Render procedural clips into a folder of shards. --append continues after an interruption."""

    out: Path
    """Folder for the shards, the manifest and a contact sheet."""
    clips: int
    """Number of clips."""
    seed: int = 0
    """Random seed of the worlds."""
    first: int = 0
    """Index of the first world, to continue a series in another folder."""
    split: Literal["training", "held_out"] = "training"
    """Split whose object families, textures and motions are used."""
    still_share: float = 0.25
    """Fraction of clips in which only the camera moves."""
    against_share: float = 0.0
    """Fraction of objects whose motion contradicts their pose: only the text determines it."""
    frozen_share: float = 0.0
    """Fraction of the other clips whose movable objects are static."""
    size: int = 128
    """Image side in pixels."""
    frames: int = 17
    """Frames per clip, 1 + 4 k for training."""
    fps: float = 8.0
    """Frames per second; the motion network is trained on 3 frames at 1 fps."""
    views: int = 3
    """Cameras per clip; the first is the input."""
    rig: bool = False
    """Place cameras all around the scene, for per-scene fitting; hold out the last two."""
    motions: tuple[str, ...] = ()
    """Only worlds with these motions, such as slides or bends. Default: all motions."""
    tracks: int = 512
    """Points followed through every clip."""
    workers: int = 1
    """Number of rendering processes."""
    append: bool = False
    """Add to an existing folder; existing clips are kept."""

    def run(self) -> None:
        """Render the clips, write them, and write a contact sheet."""
        from diff4splat.cli.common.console import ConsolePhases, note
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
    """Encode clips and their render conditions once, so that training reads no images."""

    clips: Path
    """Folder of shards."""
    out: Path
    """Folder for the latents; existing files are kept."""
    model: str = "small"
    """Model folder or name of the encoder."""
    config: str = "small"
    """Recipe whose video_diffusion stage sets the frames and their size."""
    mirror: bool = True
    """Leave out the second version of each clip, mirrored left to right with its caption."""

    def run(self) -> None:
        """Encode and write."""
        from diff4splat.cli.common.console import ConsolePhases, note
        from diff4splat.cli.common.installation import single_gaussian
        from diff4splat.cli.common.precompile import precompile_renderer
        from diff4splat.configs.recipes import find_recipe
        from diff4splat.models.hub.model import load_model
        from diff4splat.training.latents.encode import EncodingJob, encode_clips

        phases = ConsolePhases()
        precompile_renderer(single_gaussian("cpu"), phases)
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
    """Check that depth, cameras, flow and tracks of every clip are consistent."""

    folder: Path
    """Folder of shards."""
    most: int | None = None
    """Check N evenly spread clips. Default: all clips."""

    def run(self) -> None:
        """Print the largest inconsistency of each kind.

        Raises:
            InputError: a clip exceeds the tolerance of exact ground truth.
        """
        from diff4splat.cli.common.console import ConsolePhases
        from diff4splat.data_prep.checking import check_folder

        print(check_folder(self.folder, self.most, ConsolePhases()))
