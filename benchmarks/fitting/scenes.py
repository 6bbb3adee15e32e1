"""The worlds of ``fit_v1``: 20 cameras to learn from, 2 held out between them, 24 times, 200 px.

Worlds stand in a room, as capture rigs do, and are the first of their recipes that standing still
cannot explain: the mean over time of each camera's images is worse than 29 dB. Two outdoor worlds
are the hard case: grass as fine as a pixel covers half of each image.
"""

from dataclasses import dataclass
from pathlib import Path

from diff4splat.data.clip_folder import ClipFolder
from diff4splat.data_prep.synthetic.renderer.settings import DrawSettings
from diff4splat.data_prep.synthetic.worlds import WorldRecipe
from diff4splat.data_prep.writing import WorldJob, write_worlds
from diff4splat.progress.phases import Phases

RIGID = ("slides", "rolls", "hops", "drives", "rises", "bounces")
SOFT = ("squashes", "grows", "wobbles", "bends", "walks", "slithers")
INDOORS = ("room", "tabletop")
MOST_MEAN_DB = 29.0
HELD_OUT = (20, 21)


@dataclass(frozen=True, slots=True, kw_only=True)
class FitScene:
    """One world."""

    name: str
    seed: int
    index: int
    motions: tuple[str, ...]
    scenes: tuple[str, ...] | None = None

    def recipe(self) -> WorldRecipe:
        """How it is made."""
        return WorldRecipe(
            seed=self.seed, still_share=0.0, frames=24, size_px=(200, 200), views=22, rig=True,
            motions=self.motions, scenes=self.scenes,
        )  # fmt: skip


SCENES = (
    FitScene(name="indoors-rigid-0", seed=7, index=0, motions=RIGID, scenes=INDOORS),
    FitScene(name="indoors-soft-0", seed=7, index=0, motions=SOFT, scenes=INDOORS),
    FitScene(name="indoors-rigid-1", seed=7, index=1, motions=RIGID, scenes=INDOORS),
    FitScene(name="indoors-soft-1", seed=7, index=1, motions=SOFT, scenes=INDOORS),
    FitScene(name="outdoors-rigid-0", seed=7, index=0, motions=RIGID),
    FitScene(name="outdoors-soft-1", seed=7, index=1, motions=SOFT),
)


def draw(scene: FitScene, folder: Path, phases: Phases) -> Path:
    """The folder of shards with the world; drawn unless it is there."""
    target = folder / scene.name
    if not (target / "manifest.json").exists():
        job = WorldJob(
            folder=target, clips=1, recipe=scene.recipe(), first=scene.index,
            draw=DrawSettings(tracks=64),
        )  # fmt: skip
        write_worlds(job, phases)
    return target


def mean_picture_db(folder: Path) -> float:
    """How well each camera's mean image explains its frames; what decides who takes part."""
    import torch

    clip = ClipFolder(folder).clip(0)
    errors = []
    for view in clip.views[: HELD_OUT[0]]:
        rgb = view.rgb.float() / 255
        errors.append((rgb - rgb.mean(0)).square().mean())
    return float(-10 * torch.log10(torch.stack(errors).mean()))
