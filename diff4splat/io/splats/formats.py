"""Files of Gaussians at one moment, by ending: how each is written, read and judged.

| ending | what it keeps |
|---|---|
| ``.ply`` | float32 (INRIA) |
| ``.spz`` | 8 to 24 bits a number, a sixth of the size (version 3 or 4; 2 is read, too) |
| ``.glb`` | float32 (glTF 2.0, ``KHR_gaussian_splatting``) |
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

from diff4splat.io.glb.glb_file import read_glb, write_glb
from diff4splat.io.ply.ply_file import read_ply_content, write_ply
from diff4splat.io.splats.content import SplatContent
from diff4splat.io.spz.spz_file import read_spz_content, write_spz
from diff4splat.scene.gaussians import Gaussians


@dataclass(frozen=True, slots=True, kw_only=True)
class SplatFormat:
    """One kind of file."""

    write: Callable[[Gaussians, Path, float, int], None]
    """Of the Gaussians at a time in seconds; the number is the version of SPZ."""
    read: Callable[[Path], SplatContent]
    least_psnr_db: float
    """Of images of the file against images of the scene."""


def _write_ply(gaussians: Gaussians, file: Path, time_s: float, spz_version: int) -> None:
    del spz_version
    write_ply(gaussians, file, comments=(f"time_s {time_s:g}",))


def _write_spz(gaussians: Gaussians, file: Path, time_s: float, spz_version: int) -> None:
    del time_s
    write_spz(gaussians, file, spz_version)


def _write_glb(gaussians: Gaussians, file: Path, time_s: float, spz_version: int) -> None:
    del time_s, spz_version
    write_glb(gaussians, file)


def _read_glb(file: Path) -> SplatContent:
    return SplatContent(gaussians=read_glb(file))


SPLAT_FORMATS: Mapping[str, SplatFormat] = MappingProxyType(
    {
        ".ply": SplatFormat(write=_write_ply, read=read_ply_content, least_psnr_db=50.0),
        ".spz": SplatFormat(write=_write_spz, read=read_spz_content, least_psnr_db=38.0),
        ".glb": SplatFormat(write=_write_glb, read=_read_glb, least_psnr_db=50.0),
    }
)
