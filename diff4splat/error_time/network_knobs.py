"""Approximations of networks, scene files and key frames, on whole scenes of the fixed inputs.

precision-NETWORK   weights in bfloat16, float16 or int8 with one scale per output channel;
                    computed in float32, as ONNX graphs of this project do. "computed": linear
                    layers and convolutions multiply in that precision too, everything between
                    them stays float32. int8: linear layers, one scale per token; float32 holds
                    the whole numbers, so its error counts and its time does not
scene-compression   what a scene file keeps
bake-tolerance      key frames in place of a motion
network-resolution  pixels of the copy of the image that the networks see
vae-chunks          latent frames that the decoder takes at a time: exact
runtime             graphs in ONNX Runtime in place of PyTorch, with weights in fewer bits
block-caching       what blocks of the video model add, reused while their input hardly changes
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from diff4splat.error_time.block_caching import CACHINGS, NO_CACHING
from diff4splat.error_time.declared import References
from diff4splat.error_time.knobs import ApproximationSetting
from diff4splat.error_time.scene_knobs import rmse
from diff4splat.generation.approximations import REFERENCE
from diff4splat.generation.settings import GenerationSettings
from diff4splat.scene.motion.bake import TOLERANCE_PX

COMPUTED = ("bfloat16 computed", "float16 computed", "int8 computed")
PRECISIONS = ("float32", "bfloat16", "float16", "int8", *COMPUTED)
RUNTIMES = ("PyTorch", *(f"ONNX Runtime {name}" for name in ("float32", "float16", "int8")))
FILL_PARTS = ("dit", "vae", "ldrm")
"""Networks that run only where the video model fills."""
NETWORKS = (
    *("text_encoder", "monocular_depth", "motion_unet", "object_mask", "image_classifier"),
    *("dit", "vae", "ldrm"),
)
RGB_UNIT = "RMSE of RGB in [0, 1]"


def network_settings(references: References) -> tuple[ApproximationSetting, ...]:
    """All of them; nothing is loaded before the first run."""
    inputs = references.inputs
    return (
        *(_precision(part, references) for part in NETWORKS),
        _runtime(references),
        _block_caching(references),
        _resolution(inputs),
        _vae_chunks(inputs),
        _compression(inputs),
        _bake_tolerance(),
    )


def _precision(part: str, references: References) -> ApproximationSetting:
    name, fills = part.replace("_", "-"), part in FILL_PARTS
    subject = "video-scene" if fills else "scene"

    def run(precision: str) -> Any:
        from diff4splat.error_time.subjects import networks

        return networks.scenes_in_precision(part, precision, references.inputs_of(subject))

    settings = GenerationSettings(fill="video" if fills else None)
    exact = lambda: references.of_settings(subject, settings)  # noqa: E731
    return _of_scenes(
        f"precision-{name}",
        f"weights of {name} in fewer bits",
        {
            "settings": PRECISIONS,
            "default": "float32",
            "reference": "float32",
            "run_reference": exact,
        },
        run,
    )


def _runtime(references: References) -> ApproximationSetting:
    def run(runtime: str) -> Any:
        from diff4splat.error_time.subjects import runtimes

        return runtimes.run(runtime, references.inputs)

    setting = _of_scenes(
        "runtime",
        "text, depth and motion networks as ONNX graphs in place of PyTorch",
        {
            "settings": RUNTIMES,
            "default": RUNTIMES[0],
            "reference": RUNTIMES[0],
            "run_reference": lambda: references.of_settings("scene", GenerationSettings()),
        },
        run,
    )
    # The first run exports; the second is timed.
    return replace(setting, repeats=1)


def _block_caching(references: References) -> ApproximationSetting:
    def run(caching: Any) -> Any:
        from diff4splat.error_time.subjects import block_cache

        return block_cache.run(caching, references.inputs)

    def error(result: Any, reference: Any) -> float:
        from diff4splat.error_time.subjects import video

        return video.error(result, reference)

    converged = lambda: references.of_settings("video", REFERENCE.apply(GenerationSettings()))  # noqa: E731
    return ApproximationSetting(
        name="block-caching",
        summary="what blocks of the video model add, reused between steps (piecewise2)",
        error_unit="latent error over the latents' deviation",
        settings=CACHINGS,
        default=NO_CACHING,
        reference=REFERENCE,
        run=run,
        run_reference=converged,
        error=error,
        repeats=0,
        series=lambda caching: caching.series,
        label=lambda caching: caching.label,
        label_meaning="steps, or the largest change that counts as none",
    )


def _resolution(inputs: tuple[int, ...]) -> ApproximationSetting:
    def run(factor: int) -> Any:
        from diff4splat.error_time.subjects import networks

        return networks.scenes_at_factor(factor, inputs)

    return _of_scenes(
        "network-resolution",
        "networks that see a smaller copy of the image",
        {"settings": (4, 2, 1), "default": 2, "reference": 1},
        run,
        label=lambda factor: f"{128 // factor} px",
    )


def _vae_chunks(inputs: tuple[int, ...]) -> ApproximationSetting:
    def run(frames: int) -> Any:
        from diff4splat.error_time.subjects import networks

        return networks.decoded_in_chunks(frames, inputs)

    return ApproximationSetting(
        name="vae-chunks",
        summary="decoding a few latent frames at a time: nothing, as its memory is carried on",
        error_unit=RGB_UNIT,
        settings=(1, 2, 4, 16),
        default=16,
        reference=16,
        run=run,
        error=rmse,
        repeats=1,
        label_meaning="latent frames",
    )


def _compression(inputs: tuple[int, ...]) -> ApproximationSetting:
    def run(compression: str) -> Any:
        from diff4splat.error_time.subjects import files

        return files.kept(compression, inputs)

    return _of_scenes(
        "scene-compression",
        "writing a scene with fewer bits, and reading it again",
        {
            "settings": ("small", "standard", "lossless"),
            "default": "standard",
            "reference": "lossless",
        },
        run,
    )


def _bake_tolerance() -> ApproximationSetting:
    def run(tolerance_px: float | None) -> Any:
        from diff4splat.error_time.subjects import files

        return files.baked(tolerance_px)

    return ApproximationSetting(
        name="bake-tolerance",
        summary="straight lines between key frames in place of a motion",
        error_unit=RGB_UNIT,
        settings=(3.0, 1.0, 0.3, TOLERANCE_PX, 0.03),
        default=TOLERANCE_PX,
        reference=None,
        run=run,
        error=rmse,
        repeats=1,
        label_meaning="pixels that a Gaussian may be off",
    )


def _of_scenes(
    name: str,
    summary: str,
    values: dict[str, Any],
    run: Callable[[Any], Any],
    label: Callable[[Any], str] = str,
) -> ApproximationSetting:
    def error(result: Any, reference: Any) -> float:
        from diff4splat.error_time.subjects import scenes

        return scenes.error(result, reference)

    def more_errors(result: Any, reference: Any) -> Any:
        from diff4splat.error_time.subjects import scenes

        return scenes.more_errors(result, reference)

    return ApproximationSetting(
        name=name,
        summary=summary,
        error_unit=RGB_UNIT,
        run=run,
        error=error,
        more_errors=more_errors,
        label=label,
        repeats=0,
        **values,
    )
