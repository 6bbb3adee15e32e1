"""A folder of encoded clips: one tensor file per pack of clips.

    FOLDER/latents-00000.safetensors, …   latent, render_latent, validity, focal_px,
                                          center_px, pose, is_static; captions in the metadata

Axes: ``n`` clips of a pack, ``c t h w`` latents, ``f hh ww`` video frames and pixels.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.errors import FileFormatError, InputError
from diff4splat.geometry.camera import Camera, join_cameras
from diff4splat.io.scene_files.tensor_file import (
    TensorFile,
    read_metadata,
    read_tensors,
    write_tensors,
)

PATTERN = "latents-*.safetensors"
TENSORS = ("latent", "focal_px", "center_px", "pose", "is_static")


@dataclass(frozen=True, slots=True, kw_only=True)
class LatentPack:
    """Some encoded clips."""

    latent: Float[Tensor, "n c t h w"]
    render_latent: Float[Tensor, "n c t h w"] | None
    validity: Bool[Tensor, "n 1 f hh ww"] | None
    """Where the first frame shows what a pixel sees; None without a render condition."""
    cameras: Camera
    """Batch shape (n, f)."""
    is_static: Bool[Tensor, " n"]
    captions: tuple[str, ...]
    model: str = ""
    """Digest of the weights that encoded them."""
    versions: int = 1
    """So many in a row are of one clip: itself, and perhaps its mirror image."""

    def __len__(self) -> int:
        return len(self.captions)


def write_pack(pack: LatentPack, folder: Path, number: int) -> None:
    """Write one file whole or not at all.

    Raises:
        OutputError: the folder cannot be written.
    """
    cameras = pack.cameras
    tensors = {
        "latent": pack.latent.float(),
        "focal_px": cameras.focal_px,
        "center_px": cameras.center_px,
        "pose": cameras.world_from_camera,
        "is_static": pack.is_static.long(),
    }
    if pack.render_latent is not None:
        tensors["render_latent"] = pack.render_latent.float()
        tensors["validity"] = pack.validity.byte()
    metadata = {
        "captions": json.dumps(pack.captions),
        "size_px": json.dumps(cameras.size_px),
        "model": pack.model,
        "versions": str(pack.versions),
    }
    write_tensors(TensorFile(tensors=tensors, metadata=metadata), _file(folder, number))


def _file(folder: Path, number: int) -> Path:
    return folder / PATTERN.replace("*", f"{number:05d}")


def has_pack(folder: Path, number: int) -> bool:
    """Whether that file is there."""
    return _file(folder, number).is_file()


def join_packs(packs: Sequence[LatentPack]) -> LatentPack:
    """Packs of one model as one."""
    rendered = [pack for pack in packs if pack.render_latent is not None]
    return LatentPack(
        latent=torch.cat([pack.latent for pack in packs]),
        render_latent=torch.cat([pack.render_latent for pack in rendered]) if rendered else None,
        validity=torch.cat([pack.validity for pack in rendered]) if rendered else None,
        cameras=join_cameras([pack.cameras for pack in packs]),
        is_static=torch.cat([pack.is_static for pack in packs]),
        captions=tuple(text for pack in packs for text in pack.captions),
        model=packs[0].model,
        versions=packs[0].versions,
    )


def read_packs(folder: Path) -> LatentPack:
    """Every pack of a folder as one.

    Raises:
        InputError: there is none, or packs of different models.
        FileFormatError: a file is damaged.
    """
    files = sorted(folder.glob(PATTERN))
    if not files:
        raise InputError(
            f"{folder}: expected files {PATTERN}, got none; make them with "
            "'diff4splat prepare latents'"
        )
    packs = [_read_pack(file) for file in files]
    require_alike(packs, str(folder))
    return join_packs(packs)


def require_alike(packs: Sequence[LatentPack], where: str) -> None:
    """All made by one model and in one way.

    Raises:
        InputError: they are not.
    """
    kinds = {(pack.model, pack.versions, pack.render_latent is None) for pack in packs}
    if len(kinds) > 1:
        raise InputError(
            f"{where}: expected latents that one model made in one way, got those of {len(kinds)} "
            "kinds; encode the clips again"
        )


def _read_pack(file: Path) -> LatentPack:
    try:
        stored = read_tensors(file)
        pack = None if "draft" in stored else _pack(stored, read_metadata(file))
    except (FileFormatError, KeyError, ValueError, TypeError) as error:
        raise FileFormatError(
            f"{file}: expected {', '.join(TENSORS)} of encoded clips, got a file without; "
            "encode the clips again"
        ) from error
    if pack is None:
        raise FileFormatError(
            f"{file}: expected render conditions with validity, got those of an earlier release; "
            "encode the clips again"
        )
    return pack


def _pack(stored: Mapping[str, Tensor], metadata: Mapping[str, str]) -> LatentPack:
    render, validity = stored.get("render_latent"), stored.get("validity")
    if (render is None) != (validity is None):
        raise ValueError("a render condition without its latent or its validity")
    cameras = Camera(
        focal_px=stored["focal_px"],
        center_px=stored["center_px"],
        world_from_camera=stored["pose"],
        size_px=tuple(json.loads(metadata["size_px"])),
    )
    return LatentPack(
        latent=stored["latent"],
        render_latent=render,
        validity=None if validity is None else validity.bool(),
        cameras=cameras,
        is_static=stored["is_static"].bool(),
        captions=_captions(metadata, len(stored["latent"])),
        model=metadata["model"],
        versions=int(metadata["versions"]),
    )


def _captions(metadata: dict[str, str], count: int) -> tuple[str, ...]:
    """One per latent."""
    captions = tuple(json.loads(metadata["captions"]))
    if len(captions) != count:
        raise ValueError(f"{len(captions)} captions for {count} latents")
    return captions
