"""``diff4splat generate``: one photograph, a camera path and optional text to a scene folder.

photograph ─ load_image ───┐
--camera ── choose_path ───┼─ Diff4SplatPipeline ─ Scene ─ render_frames ─ write_scene_folder
--prompt ── require_prompt ┘
"""

import hashlib
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from diff4splat.cli.options.camera import CameraOptions, choose_path
from diff4splat.cli.options.guard_overwrite import require_inputs_not_overwritten

if TYPE_CHECKING:
    from diff4splat.generation.inputs.input_image import InputImage
    from diff4splat.generation.settings import GenerationSettings


@dataclass(frozen=True, kw_only=True)
class Generate:
    """Generate a 4D scene from one photo: scene file, video, depth, contact sheet and metadata."""

    image: Annotated[Path, tyro.conf.Positional]
    """The photograph: an 8-bit RGB JPEG, PNG, WebP, AVIF, TIFF or BMP."""
    camera: str = "spiral"
    """Camera presets joined by `+`, such as `spiral` or `orbit:0.25+up`, or a path file."""
    prompt: str | None = None
    """Text that describes the motion. Default: none; the text encoder is then not run."""
    out: Path = Path("out")
    """Folder for the results."""
    options: Annotated[CameraOptions, tyro.conf.arg(name="")] = field(default_factory=CameraOptions)
    seed: int = 0
    """Random seed. The same seed gives the same scene, bit for bit, on one machine."""
    model: str = "small"
    """Model folder, or a size: test or small. A size loads its bundled weights, or random ones."""
    resolution: int | None = None
    """Image size: the side of a square with the same area, in pixels. Default: the model's."""
    fov: float | None = None
    """Horizontal field of view in degrees. Default: from EXIF, else a 30 mm lens."""
    fill: Literal["none", "video"] | None = None
    """What shows where the image hides: extended layers (none), or what the video model generates
    (video). Default: the model decides; small: none."""
    still: bool = False
    """Nothing moves, with or without a prompt."""
    steps: int | None = None
    """Steps of the sampler. Default: 1 for motion, 8 for video."""
    sampler: Literal["euler", "midpoint", "heun", "multistep2"] = "multistep2"
    """ODE solver of the flow. `diff4splat report error-time` compares the solvers."""
    shift: float | None = None
    """Above 1 spends more steps on noisy levels. Default: 16 for motion, 1 for video."""
    guidance: float | None = None
    """Classifier-free guidance weight, 1 is off. Default: 1 for motion, 5 for video."""
    min_opacity: float = 0.005
    """Gaussians of lower opacity are removed."""
    skip_depth: bool = False
    """Do not render and write depth."""
    convert: bool = False
    """Convert images that are grey, CMYK, 16-bit or animated, or have alpha or a palette."""

    def run(self) -> None:
        """Check everything cheap first, then generate, render and write."""
        from diff4splat.cli.common.console import ConsolePhases, note
        from diff4splat.cli.common.precompile import precompile_renderer
        from diff4splat.cli.common.skipped_gaussians import skipped_gaussians
        from diff4splat.generation.inputs.input_cameras import path_frame, reconcile_intrinsics
        from diff4splat.generation.pipeline import Diff4SplatPipeline
        from diff4splat.io.atomic import atomic_folder
        from diff4splat.models.ldrm.plane_prior import PLANE_DEPTH
        from diff4splat.outputs.card import Result, describe, write_card
        from diff4splat.outputs.scene_folder import OUTPUT_FILES, render_frames, write_scene_folder
        from diff4splat.paths.summary import summarize
        from diff4splat.progress.run_log import RunLog

        outputs = [self.out / name for name in OUTPUT_FILES]
        require_inputs_not_overwritten((self.image, Path(self.camera)), outputs)
        settings, log = self.settings(), RunLog(phases=ConsolePhases())
        input_image = self.read_image()
        asked = choose_path(self.camera, path_frame(input_image.camera), self.options)
        input_image, path = reconcile_intrinsics(input_image, asked)
        note("; ".join((f"focal length: {input_image.focal_source}", *input_image.notes)))
        for warning in summarize(path, PLANE_DEPTH).warnings:
            note(f"camera path: {warning}")
        with atomic_folder(self.out, OUTPUT_FILES) as folder:
            pipeline = Diff4SplatPipeline.from_pretrained(self.model)
            scene = pipeline(
                input_image, path, self.prompt, seed=self.seed, settings=settings, log=log
            )
            precompile_renderer(scene.gaussians, log.phases)
            if skipped := skipped_gaussians(scene, float(scene.path.times_s[0])):
                note(skipped)
            frames = render_frames(scene, scene.path, log, with_depth=not self.skip_depth)
            result = Result.of(scene, input_image.rgb, frames.rgb[0])
            facts = describe(result, self.camera, input_image.focal_source)
            write_scene_folder(folder, result, frames, facts, log.phases)
            inputs = self.inputs(input_image, settings, pipeline.model.config.fingerprint())
            write_card(folder / "card.json", result, inputs, log)
        for line in (*(f"{name}: {value}" for name, value in facts), f"wrote {self.out}"):
            note(line)

    def settings(self) -> "GenerationSettings":
        """Seed, prompt, sampling, guidance and pruning, checked before anything is loaded."""
        from diff4splat.flow.guidance import DEFAULT_GUIDANCE
        from diff4splat.generation.settings import (
            GenerationSettings,
            MotionSettings,
            require_seed,
        )
        from diff4splat.models.hub.folders import find_config
        from diff4splat.models.text_encoder.prompt import require_prompt

        require_seed(self.seed)
        if self.prompt is not None:
            require_prompt(self.prompt, find_config(self.model).text.max_bytes)
        given = {"steps": self.steps, "shift": self.shift}
        if self.guidance is not None:
            given["guidance"] = replace(DEFAULT_GUIDANCE, weight=self.guidance)
        given = {name: value for name, value in given.items() if value is not None}
        return GenerationSettings(
            sampler=self.sampler,
            fill=self.fill,
            still=self.still,
            min_opacity=self.min_opacity,
            motion=MotionSettings(**given),
            **given,
        )

    def read_image(self) -> "InputImage":
        """The photograph at the model's size."""
        from diff4splat.generation.inputs.image_size import find_image_size
        from diff4splat.generation.inputs.input_image import load_image

        side_px, multiple_px = find_image_size(self.model, self.resolution, self.fill)
        return load_image(self.image, side_px, self.fov, self.convert, multiple_px)

    def inputs(
        self, input_image: "InputImage", settings: "GenerationSettings", model_fingerprint: str
    ) -> dict[str, object]:
        """Every setting as it was used, for the card."""
        given = {name: value for name, value in asdict(self).items() if name != "options"}
        given |= asdict(self.options) | {"generation": asdict(settings)}
        given |= {"focal_source": input_image.focal_source, "notes": input_image.notes}
        given |= {"image_sha256": file_sha256(self.image), "model_fingerprint": model_fingerprint}
        return {
            name: str(value) if isinstance(value, Path) else value for name, value in given.items()
        }


def file_sha256(file: Path) -> str:
    """Which photograph it was."""
    with file.open("rb") as opened:
        return hashlib.file_digest(opened, "sha256").hexdigest()
