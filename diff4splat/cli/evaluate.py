"""``diff4splat eval``: measure a model on test clips, beside trivial baselines.

--protocol ── load_protocol ── open_clips ─┐
--model ───── Diff4SplatPipeline ─── system ┴─ evaluate ─ results.json, results.md, items.png
"""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from diff4splat.cli.options.constraints import InputPath, Number, OutFolder
from diff4splat.cli.options.models import FeatureFiles, ModelName
from diff4splat.errors import ConfigError
from diff4splat.evaluation.systems.network_names import NETWORKS, Network

if TYPE_CHECKING:
    from diff4splat.evaluation.measures.videos import VideoNetworks
    from diff4splat.evaluation.systems.evaluated_system import EvaluatedSystem
    from diff4splat.evaluation.systems.variants import Variant
    from diff4splat.generation.settings import GenerationSettings

Without = tuple[Network | Literal["all"], ...]
"""Networks of ablations."""


@dataclass(frozen=True, kw_only=True)
class Evaluate:
    """Measure a model on the test split, with trivial baselines in the same table."""

    model: Annotated[str, ModelName()] = "small"
    """Model folder, or a size: test or small. A size loads its bundled weights, or random ones."""
    protocol: str = "held_out_v2"
    """Name of a bundled protocol, or a protocol JSON file."""
    size: Annotated[int | None, Number(least=1)] = None
    """Image side in pixels. Default: as in the protocol."""
    task: Literal["generation", "reconstruction", "text"] = "generation"
    """Generate from one image, reconstruct the input video, or test the effect of the text."""
    out: OutFolder = Path("evaluation")
    """Folder for the results."""
    items: Annotated[int | None, Number(least=1)] = None
    """Measure only the first N clips; the table is then marked as a subset."""
    features: Annotated[str | None, FeatureFiles()] = None
    """LPIPS weights: `vgg:FILE` or `alex:BACKBONE,HEADS`. Default: a distance without weights."""
    video_features: str | None = None
    """I3D weights for FVD and KVD: `i3d:FILE`. Default: fixed features without weights."""
    clip: Annotated[Path | None, InputPath(what="a folder of a CLIP", file=False)] = None
    """Folder of a CLIP (Hugging Face layout) for the CLIP score and the consistency of frames."""
    aesthetic: Annotated[
        Path | None, InputPath(what="weights of an aesthetic predictor", folder=False)
    ] = None
    """Weights of an aesthetic predictor on that CLIP."""
    steps: Annotated[int | None, Number(least=1, most=1000)] = None
    """Sampling steps of motion and video. Default: 1 for motion, 4 for video."""
    fill: Literal["none", "video"] | None = None
    """What fills hidden regions, as in `generate`. Default: that of the model."""
    photometric_steps: Annotated[int | None, Number(least=0, most=1000)] = None
    """Gradient steps on the input frames, after a reconstruction. Default: 15."""
    device: str = "cpu"
    """Where networks of generation run: cpu, cuda, or auto, which is cuda where there is one."""
    dtype: Literal["float32", "bfloat16", "float16"] = "float32"
    """What they compute in."""
    without: Without = ()
    """Also measure the same scenes without a network, in a row each: depth, motion, object-mask,
    text, video, ldrm (with the VAE), deformation; `all` is all of them."""
    seeds: Annotated[int, Number(least=1, most=64)] = 1
    """Generate each scene with this many seeds, and measure how much they differ."""
    fresh: bool = False
    """Ignore the results of an earlier run in the same folder."""

    def check(self) -> None:
        """Require a protocol that can be read."""
        from diff4splat.evaluation.protocols.protocol_json import load_protocol

        if self.task == "reconstruction" and (self.device, self.dtype) != ("cpu", "float32"):
            raise ConfigError(
                "--device, --dtype: expected without --task reconstruction, which runs on the CPU "
                "in float32; leave them out"
            )
        if self.aesthetic is not None and self.clip is None:
            raise ConfigError("--aesthetic: expected --clip, on which it works, got none; add it")
        if self.task == "reconstruction" and self.without:
            raise ConfigError(
                "--without: expected without --task reconstruction, which has no networks to "
                "choose from; leave it out"
            )
        if self.task != "reconstruction" and self.photometric_steps is not None:
            raise ConfigError(
                f"--photometric-steps: expected with --task reconstruction, got {self.task}; "
                "leave it out"
            )
        load_protocol(self.protocol)

    def run(self) -> None:
        """Measure, write, and print the table."""
        from dataclasses import replace

        from diff4splat.cli.common.console import ConsolePhases, note
        from diff4splat.cli.common.installation import single_gaussian
        from diff4splat.cli.common.precompile import precompile_renderer, precompile_sources
        from diff4splat.evaluation.evaluate import OUTPUT_FILES, RunLimits, evaluate
        from diff4splat.evaluation.measure_item import Setup
        from diff4splat.evaluation.measures.captions import grammar_caption
        from diff4splat.evaluation.protocols.datasets import open_clips
        from diff4splat.evaluation.protocols.protocol_json import load_protocol
        from diff4splat.metrics.features.load import load_features

        loaded, phases = load_protocol(self.protocol), ConsolePhases()
        if self.size is not None:
            loaded = replace(loaded, protocol=loaded.protocol.at_size((self.size, self.size)))
        features, clips = load_features(self.features), open_clips(loaded)
        with phases.phase("load model"):
            system = self.system()
        protocol = loaded.protocol
        setup = Setup(
            protocol=protocol,
            task=self.task,
            system=system,
            features=features,
            videos=self.video_networks(),
            captioner=grammar_caption,
            variants=self.variants(system),
            seeds=self.seeds,
        )
        precompile_renderer(single_gaussian("cpu"), phases)
        precompile_sources([protocol.source], phases)
        limits = RunLimits(limit=self.items, fresh=self.fresh)
        evaluation = evaluate(clips, setup, self.out, limits, phases)
        print(evaluation.markdown)
        if evaluation.outcome.resumed:
            resumed = evaluation.outcome.resumed
            note(f"{resumed} items were measured before; --fresh measures them again")
        for failure in evaluation.outcome.failures:
            note(f"failed: item {failure.item} ({failure.clip}): {failure.why}")
        note(f"wrote {', '.join(OUTPUT_FILES)} to {self.out}")

    def system(self) -> "EvaluatedSystem":
        """The model as the system of the task."""
        from functools import partial

        from diff4splat.cli.options.device import require_device
        from diff4splat.evaluation.systems.evaluated_system import (
            Generator,
            Reconstructor,
            model_identity,
            reconstruct_clip,
        )
        from diff4splat.generation.pipeline import Diff4SplatPipeline
        from diff4splat.models.hub.model import load_model, with_parts
        from diff4splat.models.networks import reconstruction_parts

        settings = self.settings()
        if self.task != "reconstruction":
            pipeline = Diff4SplatPipeline.from_pretrained(self.model)
            pipeline.to(require_device(self.device), self.dtype)
            return Generator(pipeline=pipeline, settings=settings)
        model = load_model(self.model, ())
        parts = reconstruction_parts(model.config)
        model, steps = with_parts(model, parts), settings.photometric_steps
        return Reconstructor(
            reconstruct=partial(reconstruct_clip, model, settings=settings),
            identity=model_identity(model, parts, f"reconstruction, {steps} photometric steps"),
        )

    def video_networks(self) -> "VideoNetworks":
        """What videos are measured with: fixed features, or networks whose weights are given."""
        from diff4splat.evaluation.measures.videos import VideoNetworks
        from diff4splat.metrics.features.aesthetic import read_aesthetic
        from diff4splat.metrics.features.clip import read_clip
        from diff4splat.metrics.features.fixed_features import FixedFeatures
        from diff4splat.metrics.features.load_video import load_video_features

        clip = None if self.clip is None else read_clip(self.clip)
        judge = None if self.aesthetic is None else read_aesthetic(self.aesthetic, clip)
        return VideoNetworks(
            distribution=load_video_features(self.video_features),
            frames=clip or FixedFeatures(),
            text=clip,
            aesthetic=judge,
        )

    def variants(self, system: "EvaluatedSystem") -> "tuple[Variant, ...]":
        """The same system without the networks that ``--without`` names."""
        from diff4splat.evaluation.systems.variants import ablations

        if not self.without:
            return ()
        return ablations(system, NETWORKS if "all" in self.without else self.without)

    def settings(self) -> "GenerationSettings":
        """Steps and filling as requested, the defaults elsewhere."""
        from diff4splat.generation.settings import GenerationSettings, MotionSettings

        if self.photometric_steps is not None:
            return GenerationSettings(photometric_steps=self.photometric_steps)
        if self.steps is None:
            return GenerationSettings(fill=self.fill)
        motion = MotionSettings(steps=self.steps)
        return GenerationSettings(steps=self.steps, motion=motion, fill=self.fill)
