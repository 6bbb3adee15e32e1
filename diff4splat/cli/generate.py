"""``diff4splat generate``: one photograph, a camera path and optional text to a scene folder.

The options, and what is checked of them; the work is in ``cli/generation``.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from diff4splat.cli.limits.options import LimitOptions
from diff4splat.cli.options.adapter import AdapterFolder, require_video_model
from diff4splat.cli.options.camera import CameraOptions, require_camera
from diff4splat.cli.options.constraints import Number, OutFolder
from diff4splat.cli.options.depth import (
    DepthFileOrName,
    require_depth_kind,
    require_one_photo,
)
from diff4splat.cli.options.guard_overwrite import require_inputs_not_overwritten
from diff4splat.cli.options.models import (
    ModelName,
    require_prompt_for,
    require_runtime,
)

if TYPE_CHECKING:
    from diff4splat.progress.phases import Phases
    from diff4splat.scene.scene import Scene


@dataclass(frozen=True, kw_only=True)
class Generate:
    """Generate a 4D scene from one photo: scene file, video, depth, contact sheet and metadata."""

    images: Annotated[tuple[Path, ...], tyro.conf.Positional]
    """The photo: an 8-bit RGB JPEG, PNG, WebP, AVIF, TIFF or BMP. Several photos, or a folder of
    them, each get a folder in --out."""
    camera: str = "spiral"
    """Camera presets joined by `+`, such as `spiral` or `orbit:0.25+up`, or a path file."""
    prompt: str | None = None
    """Text that names what moves, and how: `diff4splat inspect words` lists the words. Default:
    none, and nothing moves."""
    out: OutFolder = Path("out")
    """Folder for the results."""
    options: Annotated[CameraOptions, tyro.conf.arg(name="")] = field(default_factory=CameraOptions)
    seed: Annotated[int, Number(least=0, most=2**63 - 1)] = 0
    """Random seed. The same seed gives the same scene, bit for bit, on one machine."""
    model: Annotated[str, ModelName()] = "small"
    """Model folder, or a size: test or small. A size loads its bundled weights, or random ones."""
    lora: Annotated[Path | None, AdapterFolder()] = None
    """Folder with low-rank corrections of the video model that a stage trained, such as
    run/video_diffusion/adapter; needs --fill video."""
    runtime: Literal["torch", "onnx"] | None = None
    """What runs the networks: PyTorch, or ONNX Runtime on graphs that `diff4splat export onnx`
    wrote. Default: what the model folder holds."""
    resolution: Annotated[int | None, Number(least=1, most=1024)] = None
    """Image size: the side of a square with the same area, in pixels, up to 1024. Default: 512, or
    the photo's if that is smaller."""
    fit: Literal["crop", "pad"] = "crop"
    """How the photo comes to a shape that networks take: crop loses borders, pad keeps every
    pixel."""
    fov: Annotated[float | None, Number(least=1, most=170)] = None
    """Horizontal field of view in degrees. Default: from EXIF, else a 30 mm lens."""
    depth: Annotated[Path | None, DepthFileOrName()] = None
    """Depth in place of what the model predicts: a network (.onnx, or a name of `models list` that
    was downloaded), or a map of the photo by any tool (.exr, .png, .npy)."""
    depth_kind: (
        Literal["metric", "millimetres", "relative", "distance", "disparity", "inverse"] | None
    ) = None
    """What the numbers of --depth are: z in metres or millimetres, z up to a factor, length of the
    ray, 1/z with 0 at infinity, or 1/z up to factor and offset. Default: what the file states."""
    fill: Literal["none", "video"] | None = None
    """What shows where the image hides: extended layers (none), or what the video model generates
    (video). Default: the model decides; small: none."""
    still: bool = False
    """Nothing moves, with or without a prompt."""
    steps: Annotated[int | None, Number(least=1, most=1000)] = None
    """Steps of the sampler. Default: 1 for motion, 4 for video."""
    sampler: Literal[
        "euler",
        "midpoint",
        "heun",
        "multistep2",
        "dpmpp2m",
        "unipc",
        "piecewise2",
        "adaptive",
        "fitted",
    ] = "multistep2"
    """ODE solver of motion and video; without a prompt and `--fill video` nothing is sampled.
    adaptive chooses the steps by --latent-tolerance; fitted (8 or 12 steps) is fitted to the video
    model of small. `report error-time` compares the solvers."""
    latent_tolerance: Annotated[float, Number(above=0)] = 0.1
    """Error per step that --sampler adaptive allows, in units of the video latents."""
    shift: Annotated[float | None, Number(above=0)] = None
    """Above 1 spends more steps on noisy levels. Default: 16 for motion, 1 for video."""
    guidance: Annotated[float | None, Number(least=0)] = None
    """Classifier-free guidance weight, 1 is off. Default: 1 for motion; for
    video that of the model, 1 for small."""
    negative_prompt: str = ""
    """Text that the video model keeps away from, beside --prompt. Default: none."""
    color_matching_steps: Annotated[int | None, Number(least=0, most=100)] = None
    """Corrections of the colours against the photo; 0 is off. Default: 7."""
    infill: Literal["subpixel", "none"] | None = None
    """Gaussians between the photo's pixels (subpixel), or a quarter as many, twice as wide (none).
    Default: subpixel."""
    min_opacity: Annotated[float, Number(least=0, most=1)] = 0.005
    """Gaussians of lower opacity are removed."""
    video: Literal["mp4", "webm", "gif", "webp"] | None = None
    """Format of the video. Default: mp4 with H.264 where ffmpeg is installed, else webm."""
    ply: bool = False
    """Also write scene.ply: the Gaussians at the first time, for other viewers."""
    compression: Literal["lossless", "standard", "small"] = "standard"
    """Of the scene file: every bit, a tenth of the size without visible loss, or less than that."""
    device: str = "cpu"
    """Where networks run and frames are rendered: cpu, cuda (frames then by gsplat), or auto, which
    is cuda where there is one; mps runs networks alone."""
    dtype: Literal["float32", "bfloat16", "float16"] = "float32"
    """What networks compute in; half precision is for GPUs. Gaussians stay float32."""
    skip_depth: bool = False
    """Do not render and write depth."""
    convert: bool = False
    """Convert images that are grey, CMYK, 16-bit or animated, or have alpha or a palette."""
    limits: Annotated[LimitOptions, tyro.conf.arg(name="")] = field(default_factory=LimitOptions)

    @property
    def image(self) -> Path:
        """The one photo."""
        return self.images[0]

    def check(self) -> None:
        """Check the camera path, the prompt and, if there is only one, the photo's header."""
        from diff4splat.cli.common.several_inputs import photo_files

        require_camera(self.camera, self.options)
        if self.prompt is not None:
            require_prompt_for(self.model, self.prompt)
        require_runtime(self.model, self.runtime, self.device)
        require_video_model(self.lora, self.model, self.fill)
        require_depth_kind(self.depth, self.depth_kind)
        if photo_files(self.images) == list(self.images[:1]):
            self.check_photo()
        else:
            require_one_photo(self.depth)

    def check_photo(self) -> None:
        """Check the photo's header, and that nothing of it is overwritten."""
        from diff4splat.io.photos.photo_header import open_photo
        from diff4splat.outputs.file_names import OUTPUT_FILES

        outputs = [self.out / name for name in OUTPUT_FILES]
        inputs = (self.image, Path(self.camera), *filter(None, (self.depth, self.lora)))
        require_inputs_not_overwritten(inputs, outputs)
        with open_photo(self.image, self.convert):
            pass

    def run(self) -> None:
        """Generate from one photo into --out, or from several into folders of their own."""
        from diff4splat.cli.common.several_inputs import folder_names, photo_files, run_each

        photos = photo_files(self.images)
        if photos == list(self.images[:1]):
            self.run_one()
            return
        jobs = [
            (photo, replace(self, images=(photo,), out=self.out / name).run_checked)
            for photo, name in folder_names(photos).items()
        ]
        run_each(jobs)

    def run_checked(self) -> None:
        """One of several photos: its own check, then its scene."""
        self.check_photo()
        self.run_one()

    def run_one(
        self,
        phases: "Phases | None" = None,
        on_scene: "Callable[[Scene], None] | None" = None,
    ) -> None:
        """Generate, render and write.

        ``phases`` report instead of progress bars; ``on_scene`` gets the scene before it is
        rendered.
        """
        from diff4splat.cli.generation.run import generate_scene
        from diff4splat.cli.limits.generation import Outcome, promise
        from diff4splat.cli.limits.stopwatch import Stopwatch

        watch = Stopwatch.of_process() if phases is None else Stopwatch.now()
        command, promised = promise(self)
        outcome = Outcome(asked=self, promised=promised, watch=watch)
        generate_scene(command, outcome, phases, on_scene)
