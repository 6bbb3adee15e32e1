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

from diff4splat.errors import FileFormatError, InputError, ShapeError
from diff4splat.geometry.camera import Camera, join_cameras
from diff4splat.io.scene_files.tensor_checks import take_flags, take_floats
from diff4splat.io.scene_files.tensor_file import (
    TensorFile,
    read_metadata,
    read_tensors,
    write_tensors,
)
from diff4splat.paths.formats.json_text import decode_json

PATTERN = "latents-*.safetensors"
MAX_SIDE_PX, MAX_VERSIONS = 16384, 1000
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
    except (FileFormatError, ShapeError) as error:
        raise FileFormatError(
            f"{file}: expected {', '.join(TENSORS)} of encoded clips, got others ({error}); "
            "encode the clips again"
        ) from error
    if pack is None:
        raise FileFormatError(
            f"{file}: expected render conditions with validity, got those of an earlier release; "
            "encode the clips again"
        )
    return pack


def _pack(stored: Mapping[str, Tensor], metadata: Mapping[str, str]) -> LatentPack:
    if "model" not in metadata:
        raise FileFormatError("model: expected the digest of its weights, got none")
    text = {key: decode_json(metadata.get(key, "")) for key in ("size_px", "captions", "versions")}
    latent = _clips(stored, "latent", (None, None, None, None, None))
    count, focal_px = len(latent), take_floats(stored, "focal_px", (len(latent), None, 2))
    frames, size_px = focal_px.shape[1], _size_px(text["size_px"])
    is_rendered = "render_latent" in stored or "validity" in stored
    return LatentPack(
        latent=latent,
        render_latent=_clips(stored, "render_latent", latent.shape) if is_rendered else None,
        validity=_validity(stored, (count, 1, frames, *size_px)) if is_rendered else None,
        cameras=Camera(
            focal_px=focal_px,
            center_px=take_floats(stored, "center_px", (count, frames, 2)),
            world_from_camera=take_floats(stored, "pose", (count, frames, 4, 4)),
            size_px=size_px,
        ),
        is_static=take_flags(stored, "is_static", (count,), torch.int64),
        captions=_captions(text["captions"], count),
        model=metadata["model"],
        versions=_versions(text["versions"]),
    )


def _clips(stored: Mapping[str, Tensor], name: str, shape: tuple[int | None, ...]) -> Tensor:
    values = take_floats(stored, name, tuple(shape))
    if values.dtype != torch.float32 or not len(values):
        raise FileFormatError(f"{name}: expected float32 of some clips, got {values.dtype}")
    return values


def _validity(stored: Mapping[str, Tensor], shape: tuple[int, ...]) -> Tensor:
    return take_flags(stored, "validity", shape, torch.uint8)


def _size_px(value: object) -> tuple[int, int]:
    whole = isinstance(value, list) and len(value) == 2 and all(type(side) is int for side in value)
    if not whole or not all(1 <= side <= MAX_SIDE_PX for side in value):
        raise FileFormatError(f"size_px: expected height and width, got {str(value)[:60]}")
    return value[0], value[1]


def _captions(value: object, count: int) -> tuple[str, ...]:
    """One per latent."""
    texts = isinstance(value, list) and all(isinstance(text, str) for text in value)
    if not texts or len(value) != count:
        raise FileFormatError(f"captions: expected {count} texts, got {str(value)[:60]}")
    return tuple(value)


def _versions(value: object) -> int:
    if type(value) is not int or not 1 <= value <= MAX_VERSIONS:
        raise FileFormatError(f"versions: expected 1 to {MAX_VERSIONS}, got {str(value)[:60]}")
    return value
