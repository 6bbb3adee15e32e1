"""``diff4splat reconstruct``: a video with known cameras to a moving scene, in one pass.

DATA ── read_capture ── choose_video ── reconstruct ── render_into ── write_scene_folder
"""

from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from diff4splat.cli.options.capture import CaptureOptions, inputs_for_card
from diff4splat.cli.options.constraints import InputPath, Number, OutFolder
from diff4splat.cli.options.device import require_device
from diff4splat.cli.options.guard_overwrite import require_inputs_not_overwritten
from diff4splat.cli.options.models import ModelName

if TYPE_CHECKING:
    from diff4splat.generation.inputs.input_video import InputVideo, VideoChoice
    from diff4splat.generation.reconstruction import Reconstruction
    from diff4splat.generation.video.reconstruction_quality import ReconstructionQuality
    from diff4splat.models.hub.model import Model
    from diff4splat.progress.run_log import RunLog

UNIT_UNKNOWN = "the camera moves too little to show distances; give --median-depth if you know it"


@dataclass(frozen=True, kw_only=True)
class Reconstruct:
    """Reconstruct a moving scene from video with known cameras, by the networks alone: seconds."""

    data: Annotated[Path, tyro.conf.Positional, InputPath(what="images with poses")]
    """Folder or file with images, poses and times, as for `fit`."""
    out: OutFolder = Path("out")
    """Folder for the results."""
    camera: Annotated[int | None, Number(least=0)] = None
    """Number of the camera. Default: the first that is not held out."""
    frames: Annotated[int, Number(least=5, most=33)] = 9
    """Frames of the video that the networks see, spread evenly: 1 + 4 k."""
    resolution: Annotated[int, Number(least=1, most=256)] = 64
    """Image size: the side of a square with the same area, in pixels. The model was trained at
    64; at 128 static surfaces are sharper, and what moves frays."""
    median_depth: Annotated[float | None, Number(above=0)] = None
    """Median depth of the first frame, in the unit of the cameras. Default: the one with which the
    depth of the model explains the video best."""
    photometric_steps: Annotated[int | None, Number(least=0, most=1000)] = None
    """Gradient steps on the input frames after the networks; 0 is off. Default: 15."""
    model: Annotated[str, ModelName()] = "small"
    """Model folder, or a size: test or small. A size loads its bundled weights, or random ones."""
    options: Annotated[CaptureOptions, tyro.conf.arg(name="")] = field(
        default_factory=CaptureOptions
    )
    compression: Literal["lossless", "standard", "small"] = "standard"
    """Of the scene file: every bit, a tenth of the size without visible loss, or less than that."""
    device: str = "cpu"
    """Where networks run and frames are rendered: cpu, cuda, or auto, which is cuda where there is
    one."""

    def check(self) -> None:
        """Nothing of the input is overwritten."""
        from diff4splat.outputs.file_names import OUTPUT_FILES

        outputs = [self.out / name for name in OUTPUT_FILES]
        require_inputs_not_overwritten((self.data,), outputs)

    def run(self) -> None:
        """Read, reconstruct, measure, write."""
        from diff4splat.cli.common.console import ConsolePhases, note
        from diff4splat.generation.inputs.input_video import choose_video
        from diff4splat.generation.video.reconstruction_quality import measure_quality
        from diff4splat.progress.run_log import RunLog

        log = RunLog(phases=ConsolePhases())
        device = require_device(self.device)
        capture, model = self.options.read(self.data), self.loaded_model(device)
        choice = self.choice(model)
        video = choose_video(capture, choice)
        for line in (*capture.notes, *video.notes):
            note(line)
        result = self.reconstruction(model, video, log)
        quality = measure_quality(result.scene, video, capture, choice)
        if not result.scale.observable:
            note(UNIT_UNKNOWN)
        for line in (*self.write(result, video, quality, log), f"wrote {self.out}"):
            note(line)

    def loaded_model(self, device: str) -> "Model":
        """The parts that reconstruct."""
        import torch

        from diff4splat.models.hub.model import load_model

        model = load_model(self.model, parts=())
        model.networks.to(torch.device(device))
        return model

    def choice(self, model: "Model") -> "VideoChoice":
        """Which frames, and how large."""
        from diff4splat.generation.inputs.input_video import VideoChoice

        return VideoChoice(
            camera=self.camera,
            frames=self.frames,
            side_px=self.resolution,
            multiple_px=model.config.token_px,
        )

    def reconstruction(
        self, model: "Model", video: "InputVideo", log: "RunLog"
    ) -> "Reconstruction":
        """The scene, with the settings of the command."""
        from diff4splat.cli.common.installation import single_gaussian
        from diff4splat.cli.common.precompile import precompile_renderer
        from diff4splat.generation.reconstruction import reconstruct
        from diff4splat.generation.settings import GenerationSettings

        given = {}
        if self.photometric_steps is not None:
            given["photometric_steps"] = self.photometric_steps
        settings = GenerationSettings(**given)
        precompile_renderer(single_gaussian("cpu"), log.phases)
        return reconstruct(model, video, self.median_depth, settings, log)

    def write(
        self,
        result: "Reconstruction",
        video: "InputVideo",
        quality: "ReconstructionQuality",
        log: "RunLog",
    ) -> list[str]:
        """All files, together; returns lines about the result."""
        from diff4splat.cli.options.device import render_device
        from diff4splat.io.atomic import atomic_folder
        from diff4splat.io.movies.background_movie import BackgroundMovie
        from diff4splat.io.movies.movie import default_suffix
        from diff4splat.outputs.card import Result, write_card
        from diff4splat.outputs.file_names import OUTPUT_FILES
        from diff4splat.outputs.filming import FilmRecord
        from diff4splat.outputs.scene_folder import (
            frames_per_second,
            render_into,
            write_scene_folder,
        )

        path = result.scene.path
        record = FilmRecord(path=path, device=render_device(self.device))
        facts = facts_of(result, quality, self.median_depth is not None)
        with atomic_folder(self.out, OUTPUT_FILES) as folder:
            with BackgroundMovie(
                folder / f"video{default_suffix()}", frames_per_second(path)
            ) as movie:
                render_into(movie, result.scene, record, log)
                made = Result.of(result.scene, video.rgb[0], record.first_rgb)
                scene_file = write_scene_folder(
                    folder, made, record, facts, log.phases, self.compression
                )
                notes = movie.finish()
            inputs = inputs_for_card(self) | {
                "quality": asdict(quality),
                "scale": asdict(result.scale),
            }
            write_card(folder / "card.json", made, inputs, log, scene_file)
        return [*notes, *(f"{name}: {value}" for name, value in facts)]


def facts_of(
    result: "Reconstruction", quality: "ReconstructionQuality", depth_given: bool
) -> tuple[tuple[str, str], ...]:
    """What belongs beside the images."""
    scene, scale = result.scene, result.scale
    height, width = scene.path.cameras.size_px
    moving = len(scene.motion.moving_index)
    source = "given" if depth_given else "found" if scale.observable else "not shown by the video"
    others = quality.other_frames_db
    return (
        ("Image", f"{width} by {height} px"),
        ("Gaussians", f"{len(scene.gaussians):,}, {moving:,} of them moving"),
        ("Median depth", f"{scale.median_depth:.4g} units of the cameras, {source}"),
        ("Input frames", f"{quality.input_frames_db:.2f} dB"),
        (
            "Other frames",
            "none"
            if others is None
            else f"{others:.2f} dB over {quality.other_frames} that the networks did not see",
        ),
    )
