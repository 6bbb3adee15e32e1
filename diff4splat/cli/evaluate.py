"""``diff4splat eval``: how good a model is on clips that nobody trained on, beside trivial answers.

--protocol ── load_protocol ── open_clips ─┐
--model ───── Diff4SplatPipeline ── subject ┴─ evaluate ─ results.json, results.md, items.png
"""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from diff4splat.evaluation.systems import Subject
    from diff4splat.generation.settings import GenerationSettings


@dataclass(frozen=True, kw_only=True)
class Evaluate:
    """Measure a model on held-out clips, with trivial baselines in the same table."""

    model: str = "small"
    """A model folder, or a size (test, small): its shipped weights, else random ones."""
    protocol: str = "held_out_v2"
    """Name of a protocol that ships, or a JSON file of your own."""
    size: int | None = None
    """Picture side in pixels, such as the model's own; the protocol's if left out."""
    task: Literal["generation", "reconstruction", "text"] = "generation"
    """From the first picture; from the input video; or does the text decide what moves."""
    out: Path = Path("evaluation")
    """Folder for the results."""
    items: int | None = None
    """Measure the first so many clips only; the table then says that it is a subset."""
    features: str | None = None
    """LPIPS weights that you have, as `vgg:FILE` or `alex:TRUNK,HEADS`; if left out, a stand-in."""
    steps: int | None = None
    """Steps of the samplers of motion and video. If left out, 1 for motion, 8 for video."""
    fill: Literal["none", "video"] | None = None
    """What fills hidden regions, as in `generate`. If left out, the model decides."""
    fresh: bool = False
    """Measure again what an earlier run into the same folder has measured."""

    def run(self) -> None:
        """Check everything cheap first, then measure, write, and print the table."""
        from dataclasses import replace

        from diff4splat.cli.console import ConsolePhases, note
        from diff4splat.cli.installation import speck
        from diff4splat.cli.precompile import precompile_renderer, precompile_sources
        from diff4splat.evaluation.captions import grammar_caption
        from diff4splat.evaluation.datasets import open_clips
        from diff4splat.evaluation.evaluate import OUTPUT_FILES, Extent, evaluate
        from diff4splat.evaluation.measuring import Setup
        from diff4splat.evaluation.protocol_json import load_protocol
        from diff4splat.metrics.features.load import load_features

        loaded, phases = load_protocol(self.protocol), ConsolePhases()
        if self.size is not None:
            loaded = replace(loaded, protocol=loaded.protocol.at_size((self.size, self.size)))
        features, clips = load_features(self.features), open_clips(loaded)
        with phases.phase("load model"):
            subject = self.subject()
        protocol = loaded.protocol
        setup = Setup(
            protocol=protocol,
            task=self.task,
            subject=subject,
            features=features,
            captioner=grammar_caption,
        )
        precompile_renderer(speck("cpu"), phases)
        precompile_sources([protocol.source], phases)
        extent = Extent(limit=self.items, fresh=self.fresh)
        found = evaluate(clips, setup, self.out, extent, phases)
        print(found.markdown)
        if found.outcome.taken_up:
            note(
                f"{found.outcome.taken_up} items were measured before; --fresh measures them again"
            )
        for failure in found.outcome.failures:
            note(f"failed: item {failure.item} ({failure.clip}): {failure.why}")
        note(f"wrote {', '.join(OUTPUT_FILES)} to {self.out}")

    def subject(self) -> "Subject":
        """The model in the role that the task asks for."""
        from functools import partial

        from diff4splat.evaluation.systems import (
            Generator,
            Reconstructor,
            model_identity,
            reconstruct_clip,
        )
        from diff4splat.generation.pipeline import Diff4SplatPipeline
        from diff4splat.generation.plan import RECONSTRUCTION_PARTS
        from diff4splat.models.hub.model import load_model

        if self.task != "reconstruction":
            pipeline = Diff4SplatPipeline.from_pretrained(self.model)
            return Generator(pipeline=pipeline, settings=self.settings())
        model = load_model(self.model, RECONSTRUCTION_PARTS)
        return Reconstructor(
            reconstruct=partial(reconstruct_clip, model),
            identity=model_identity(model, RECONSTRUCTION_PARTS, "reconstruction"),
        )

    def settings(self) -> "GenerationSettings":
        """Steps and filling as asked for, the defaults elsewhere."""
        from diff4splat.generation.settings import GenerationSettings, MotionSettings

        if self.steps is None:
            return GenerationSettings(fill=self.fill)
        motion = MotionSettings(steps=self.steps)
        return GenerationSettings(steps=self.steps, motion=motion, fill=self.fill)
