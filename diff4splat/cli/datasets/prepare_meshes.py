"""``diff4splat prepare meshes``: objects that people modelled, for worlds and cutouts."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from diff4splat.cli.options.constraints import InputPath, Number, OutFile, OutFolder


@dataclass(frozen=True, kw_only=True)
class PrepareMeshes:
    """Collect OBJ meshes and their images in one file, for prepare synth --meshes."""

    sources: Annotated[tuple[Path, ...], tyro.conf.Positional, InputPath(what="OBJ meshes")]
    """Folders of OBJ files, or libraries of Sweet Home 3D (.sh3f)."""
    out: OutFile
    """Library file, .safetensors."""
    license: str
    """SPDX name of the licence of all meshes, such as CC-BY-3.0."""
    most_triangles: Annotated[int, Number(least=1)] = 30_000
    """Skip meshes with more triangles."""

    def run(self) -> None:
        """Read, reduce and write."""
        from diff4splat.cli.common.console import ConsolePhases, note
        from diff4splat.data_prep.synthetic.meshes.prepare import MeshJob, prepare_meshes

        job = MeshJob(
            sources=self.sources,
            file=self.out,
            license=self.license,
            most_triangles=self.most_triangles,
        )
        report = prepare_meshes(job, ConsolePhases())
        note(f"wrote {report.written} meshes to {self.out}{report.reasons}")


@dataclass(frozen=True, kw_only=True)
class PrepareMeshCutouts:
    """Draw the meshes of a library alone, from several sides, as cutouts with names."""

    meshes: Annotated[Path, tyro.conf.Positional, InputPath(what="a mesh library", folder=False)]
    """Mesh library (prepare meshes)."""
    out: OutFolder
    """Folder for PNG images with transparency, and names.json for prepare cutouts --names."""
    views: Annotated[int, Number(least=1, most=100)] = 8
    """Images of each mesh that has a name the model can learn."""
    size: Annotated[int, Number(least=16, most=1024)] = 192
    """Longer side of an object in pixels."""
    seed: Annotated[int, Number(least=0)] = 0
    """Random seed of views and light."""

    def run(self) -> None:
        """Draw and write."""
        from diff4splat.cli.common.console import ConsolePhases, note
        from diff4splat.data_prep.synthetic.meshes.cutouts import MeshCutoutJob, draw_cutouts

        job = MeshCutoutJob(
            meshes=self.meshes,
            folder=self.out,
            views=self.views,
            size_px=self.size,
            seed=self.seed,
        )
        note(f"wrote {draw_cutouts(job, ConsolePhases())} cutouts to {self.out}")
