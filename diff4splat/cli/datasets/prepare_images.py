"""``diff4splat prepare panoramas`` and ``cutouts``: images that others made, without depth."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from diff4splat.cli.options.constraints import InputPath, Number, OutFolder


@dataclass(frozen=True, kw_only=True)
class PreparePanoramas:
    """Cut photographs without depth from panoramas, to train depth on (data.photographs)."""

    panoramas: Annotated[
        tuple[Path, ...], tyro.conf.Positional, InputPath(what="a panorama", folder=False)
    ]
    """Equirectangular images, twice as wide as high; radiance of OpenEXR files is exposed."""
    out: OutFolder
    """Folder for the photographs."""
    views: Annotated[int, Number(least=1, most=1000)] = 24
    """Photographs of each panorama, all around; those of one plain colour are dropped."""
    size: Annotated[int, Number(least=16, most=4096)] = 160
    """Side in pixels."""
    seed: Annotated[int, Number(least=0)] = 0
    """Random seed of pitch, roll and field of view."""

    def run(self) -> None:
        """Cut and write."""
        from diff4splat.cli.common.console import ConsolePhases, note
        from diff4splat.data_prep.panoramas.cut import PanoramaJob, cut_panoramas

        job = PanoramaJob(
            panoramas=self.panoramas,
            folder=self.out,
            views=self.views,
            size_px=self.size,
            seed=self.seed,
        )
        note(f"wrote {cut_panoramas(job, ConsolePhases())} photographs to {self.out}")


@dataclass(frozen=True, kw_only=True)
class PrepareCutouts:
    """Paste named cutouts over photographs, to teach names of objects."""

    cutouts: Annotated[Path, tyro.conf.Positional, InputPath(what="a folder", file=False)]
    """Folder of PNG or WebP images of one object each, with transparency, and its subfolders."""
    photographs: Annotated[Path, InputPath(what="a folder of photographs", file=False)]
    """Folder of photographs: backgrounds, and textures of the objects."""
    out: OutFolder
    """Folder for the shards, the manifest and a contact sheet."""
    license: str
    """SPDX name of the licence of cutouts and photographs, such as MIT."""
    names: Annotated[Path | None, InputPath(what="a table of names", folder=False)] = None
    """JSON: paths in the folder of cutouts, without suffix, and nouns. Default: --package."""
    package: Literal["fluent-emoji", "openclipart"] = "fluent-emoji"
    """Which public set of cutouts the folder holds: npm @lobehub/fluent-emoji-3d or Debian
    openclipart-png."""
    images: Annotated[int, Number(least=1)] = 8000
    """Number of images."""
    size: Annotated[int, Number(least=16, most=4096)] = 128
    """Side in pixels."""
    seed: Annotated[int, Number(least=0)] = 0
    """Random seed of what is pasted where."""
    keep_colors: bool = False
    """Give no cutout other colours or textures: to measure, not to train."""
    append: bool = False
    """Add to an existing folder; existing images are kept."""

    def run(self) -> None:
        """Compose, write, and write a contact sheet."""
        from diff4splat.cli.common.console import ConsolePhases, note
        from diff4splat.data_prep.clip_sheet import write_clip_sheet
        from diff4splat.data_prep.cutouts.cutout import PUBLIC_NAMES
        from diff4splat.data_prep.cutouts.write import CutoutJob, write_cutouts

        job = CutoutJob(
            cutouts=self.cutouts,
            names=self.names or PUBLIC_NAMES[self.package],
            photographs=self.photographs,
            folder=self.out,
            license=self.license,
            images=self.images,
            size_px=self.size,
            seed=self.seed,
            keep_colors=self.keep_colors,
        )
        written = write_cutouts(job, ConsolePhases(), self.append)
        write_clip_sheet(self.out, self.out / "clips.png")
        note(f"wrote {written} images to {self.out}; look at clips.png there")
