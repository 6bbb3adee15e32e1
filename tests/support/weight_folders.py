"""Copies of the bundled model in which single weight files are changed, broken or absent."""

from collections.abc import Callable, Iterable
from pathlib import Path

import torch
from safetensors.torch import load_file, save_file

from diff4splat.models.hub.bundled_weights import bundled_folder
from diff4splat.models.hub.checksums import SUMS_FILE

Change = Callable[[Path], None]
"""Rewrites one weight file."""


def copied_folder(folder: Path, changes: Iterable[tuple[str, Change]] = ()) -> Path:
    """The bundled ``small`` model without checksums; each change is of one part's file.

    Files that stay as they are become links.
    """
    folder.mkdir(parents=True)
    for file in bundled_folder("small").iterdir():
        if file.name != SUMS_FILE:
            (folder / file.name).symlink_to(file)
    for part, change in changes:
        file = folder / f"{part}.safetensors"
        source = file.resolve()
        file.unlink()
        file.write_bytes(source.read_bytes())
        change(file)
    return folder


def with_noise(file: Path, share: float = 0.1) -> None:
    """Every tensor with noise of ``share`` of its standard deviation."""
    generator = torch.Generator().manual_seed(0)
    tensors = {}
    for key, value in load_file(file).items():
        sigma = share * value.float().std(correction=0)
        noise = sigma * torch.randn(value.shape, generator=generator)
        tensors[key] = (value.float() + noise).to(value.dtype)
    save_file(tensors, file)


def with_nan(file: Path) -> None:
    """Nothing but NaN; of weights in eight bits the scales."""
    stored = load_file(file)
    tensors = {
        key: torch.full_like(value, torch.nan) if value.is_floating_point() else value
        for key, value in stored.items()
    }
    save_file(tensors, file)


def with_garbage(file: Path) -> None:
    """Not even safetensors."""
    file.write_bytes(b"no weights")


def without_file(file: Path) -> None:
    """Absent."""
    file.unlink()
