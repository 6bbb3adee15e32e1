"""Encoded clips made of numbers that can be told apart, for several test files."""

from pathlib import Path

import torch

from diff4splat.geometry.camera import Camera
from diff4splat.training.latents.latent_shards import LatentPack, write_pack
from diff4splat.training.recipe.data import DataSettings, SourceSettings
from diff4splat.training.recipe.losses import FlowLosses
from diff4splat.training.recipe.stage import StageRecipe

FRAMES, SIZE_PX = 5, (24, 24)


def make_pack(
    is_static: list[bool],
    first: int = 0,
    rendered: bool = True,
    versions: int = 1,
    model: str = "m",
) -> LatentPack:
    """Clip number ``first + k`` has that number as its latent, and in its caption."""
    count = len(is_static)
    number = torch.arange(first, first + count, dtype=torch.float32)
    latent = number[:, None, None, None, None].expand(count, 4, 2, 3, 3).contiguous()
    pose = torch.eye(4).repeat(count, FRAMES, 1, 1)
    pose[:, :, 0, 3] = number[:, None] * 0.01 * torch.arange(FRAMES)
    return LatentPack(
        latent=latent,
        render_latent=latent + 0.5 if rendered else None,
        validity=_validity(number) if rendered else None,
        cameras=Camera(
            focal_px=torch.full((count, FRAMES, 2), 20.0) + number[:, None, None],
            center_px=torch.full((count, FRAMES, 2), 12.0),
            world_from_camera=pose,
            size_px=SIZE_PX,
        ),
        is_static=torch.tensor(is_static, dtype=torch.bool),
        captions=tuple(f"clip {first + k}, “said”" for k in range(count)),
        model=model,
        versions=versions,
    )


def _validity(number: torch.Tensor) -> torch.Tensor:
    """All valid but for one column of the last frame, another for every clip."""
    validity = torch.ones(len(number), 1, FRAMES, *SIZE_PX, dtype=torch.bool)
    for index, column in enumerate(number.long() % SIZE_PX[1]):
        validity[index, :, -1, :, column] = False
    return validity


def latent_folder(folder: Path, *packs: LatentPack) -> Path:
    """The packs as files."""
    for number, pack in enumerate(packs):
        write_pack(pack, folder, number)
    return folder


def latents_of(folder: Path, still_share: float = 0.5, weight: float = 1.0) -> SourceSettings:
    """The folder as a source."""
    return SourceSettings(
        kind="latents", folder=str(folder), still_share=still_share, weight=weight
    )


def learning_from(*sources: SourceSettings) -> StageRecipe:
    """A video_diffusion stage with these sources."""
    return StageRecipe(
        name="video_diffusion",
        kind="video_diffusion",
        steps=1,
        global_batch=2,
        micro_batch=2,
        trained=("dit",),
        losses=FlowLosses(),
        data=DataSettings(sources=sources, workers=0),
    )
