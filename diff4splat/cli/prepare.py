"""``diff4splat prepare``: make training clips, encode them, and check their consistency."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from diff4splat.cli.options.constraints import InputPath, Number, OutFolder
from diff4splat.cli.options.models import ModelName

DEFAULT_STATIC_SHARE = 0.25


@dataclass(frozen=True, kw_only=True)
class PrepareSynthetic:
    """Render procedural clips into a folder of shards. --append continues after an interruption."""

    out: OutFolder
    """Folder for the shards, the manifest and a contact sheet."""
    clips: Annotated[int, Number(least=1)]
    """Number of clips."""
    seed: Annotated[int, Number(least=0)] = 0
    """Random seed of the worlds."""
    first: Annotated[int, Number(least=0)] = 0
    """Index of the first world, to continue a series in another folder."""
    split: Literal["training", "held_out"] = "training"
    """Split whose object families, textures and motions are used."""
    still_share: Annotated[float | None, Number(least=0, most=1)] = None
    """Fraction of clips in which only the camera moves. Default: 0.25, and 0 with --rig."""
    against_share: Annotated[float, Number(least=0, most=1)] = 0.0
    """Fraction of objects whose motion contradicts their pose: only the text determines it."""
    frozen_share: Annotated[float, Number(least=0, most=1)] = 0.0
    """Fraction of the other clips whose movable objects are static."""
    size: Annotated[int, Number(least=8, most=4096)] = 128
    """Image side in pixels."""
    frames: Annotated[int, Number(least=1, most=1000)] = 17
    """Frames per clip, 1 + 4 k for training."""
    fps: Annotated[float, Number(least=0.1, most=1000)] = 8.0
    """Frames per second; the motion network is trained on 3 frames at 1 fps."""
    views: Annotated[int, Number()] = 3
    """Cameras per clip; the first is the input."""
    rig: bool = False
    """Place cameras all around the scene, for per-scene fitting; hold out the last two."""
    free_cameras: bool = False
    """Place cameras after the first anywhere: above, close, rolled, other lenses; for depth."""
    arrangements: bool = False
    """Static objects before walls, in rooms or on open ground, from any side; for depth."""
    composite_share: Annotated[float, Number(least=0, most=1)] = 0.0
    """Fraction of objects that are random shapes without a name."""
    person_share: Annotated[float, Number(least=0, most=1)] = 0.0
    """Fraction of the other objects that are people, without a name."""
    meshes: Annotated[Path | None, InputPath(what="a mesh library", folder=False)] = None
    """Mesh library (prepare meshes), for objects of --arrangements."""
    mesh_share: Annotated[float, Number(least=0, most=1)] = 0.5
    """With --meshes: fraction of objects that come from it."""
    furnished_share: Annotated[float, Number(least=0, most=1)] = 0.5
    """With --meshes: fraction of places that are furnished with objects of natural size."""
    motions: tuple[str, ...] = ()
    """Only worlds with these motions, such as slides or bends. Default: all motions."""
    without_objects: Annotated[int, Number(least=0, most=7)] = 0
    """Instead of a clip: its first image, and this many views without one object; for shadows."""
    tracks: Annotated[int, Number(least=0)] = 512
    """Points followed through every clip."""
    workers: Annotated[int, Number(least=1)] = 1
    """Number of rendering processes."""
    append: bool = False
    """Add to an existing folder; existing clips are kept."""

    def check(self) -> None:
        """Check the number of cameras, which --rig decides about."""
        views = Number(least=4, most=64) if self.rig else Number(least=1, most=8)
        views.check("--views", self.views)

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
            still_share=self.static_world_share(),
            against_share=self.against_share,
            frozen_share=self.frozen_share,
            frames=self.frames,
            fps=self.fps,
            size_px=(self.size, self.size),
            views=self.views,
            rig=self.rig,
            free_cameras=self.free_cameras,
            arrangements=self.arrangements,
            composite_share=self.composite_share,
            person_share=self.person_share,
            meshes=self.meshes,
            mesh_share=self.mesh_share if self.meshes else 0.0,
            furnished_share=self.furnished_share if self.meshes else 0.0,
            motions=self.motions or None,
        )
        job = WorldJob(
            folder=self.out,
            clips=self.clips,
            recipe=recipe,
            first=self.first,
            draw=DrawSettings(tracks=self.tracks),
            workers=self.workers,
            without_objects=self.without_objects,
        )
        phases = ConsolePhases()
        drawn = write_worlds(job, phases, self.append)
        write_clip_sheet(self.out, self.out / "clips.png")
        seconds = phases.seconds["draw clips"]
        note(f"wrote {drawn} clips to {self.out} in {seconds:.0f} s; look at clips.png there")

    def static_world_share(self) -> float:
        """Static cameras around a static world would show one moment only."""
        if self.still_share is not None:
            return self.still_share
        return 0.0 if self.rig else DEFAULT_STATIC_SHARE


@dataclass(frozen=True, kw_only=True)
class PrepareLatents:
    """Encode clips and their render conditions once, so that training reads no images."""

    clips: Annotated[Path, InputPath(what="a folder of shards", file=False)]
    """Folder of shards."""
    out: OutFolder
    """Folder for the latents; existing files are kept."""
    model: Annotated[str, ModelName()] = "small"
    """Model folder or name of the encoder."""
    config: str = "small"
    """Recipe whose video_diffusion stage sets the frames and their size."""
    mirror: bool = True
    """Leave out the second version of each clip, mirrored left to right with its caption."""

    def check(self) -> None:
        """Require a recipe that there is."""
        from diff4splat.configs.recipes import find_recipe

        find_recipe(self.config).stage_of_kind("video_diffusion")

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

    folder: Annotated[Path, InputPath(what="a folder of shards", file=False)]
    """Folder of shards."""
    most: Annotated[int | None, Number(least=1)] = None
    """Check N evenly spread clips. Default: all clips."""

    def run(self) -> None:
        """Print the largest inconsistency of each kind.

        Raises:
            InputError: a clip exceeds the tolerance of exact ground truth.
        """
        from diff4splat.cli.common.console import ConsolePhases
        from diff4splat.data_prep.checking import check_folder

        print(check_folder(self.folder, self.most, ConsolePhases()))
