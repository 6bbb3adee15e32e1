"""One photo to a scene folder.

photo, --camera, --depth ─ inputs ─┐
options ──────────────── settings ─┴─ Diff4SplatPipeline ─ Scene ─ results ─ folder
"""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from diff4splat.cli.common.console import ConsolePhases, note
from diff4splat.cli.generation.inputs import given_depth, read_inputs
from diff4splat.cli.generation.results import write_results
from diff4splat.cli.generation.settings import generation_settings, settings_record
from diff4splat.cli.options.device import require_device
from diff4splat.generation.pipeline import Diff4SplatPipeline
from diff4splat.io.atomic import atomic_folder
from diff4splat.models.onnx.manifest import has_graphs
from diff4splat.outputs.card import write_card
from diff4splat.outputs.file_names import OUTPUT_FILES
from diff4splat.progress.phases import Phases
from diff4splat.progress.run_log import RunLog
from diff4splat.scene.scene import Scene

if TYPE_CHECKING:
    from diff4splat.cli.generate import Generate
    from diff4splat.cli.limits.generation import Outcome


def generate_scene(
    command: "Generate",
    outcome: "Outcome",
    phases: Phases | None = None,
    on_scene: Callable[[Scene], None] | None = None,
) -> None:
    """Generate with the settings as they are; ``outcome`` compares with what was expected."""
    settings, log = generation_settings(command), RunLog(phases=phases or ConsolePhases())
    # Graphs stay on the CPU.
    device = "cpu" if has_graphs(Path(command.model)) else require_device(command.device)
    depth = given_depth(command)
    input_image, path = read_inputs(command)
    for line in outcome.promised.lines():
        note(line)
    with atomic_folder(command.out, OUTPUT_FILES) as folder:
        pipeline = Diff4SplatPipeline.from_pretrained(command.model, command.lora)
        pipeline.to(device, command.dtype)
        scene = pipeline(
            input_image,
            path,
            command.prompt,
            seed=command.seed,
            settings=settings,
            log=log,
            depth=depth,
        )
        if on_scene is not None:
            on_scene(scene)
        result, scene_file, lines = write_results(command, folder, scene, input_image, log)
        asked = settings_record(command, input_image, settings)
        asked |= {"model_fingerprint": pipeline.model.config.fingerprint()}
        record = outcome.record(result)
        write_card(folder / "card.json", result, asked, log, scene_file, record)
    for line in (*lines, *filter(None, [record["not_held"]]), f"wrote {command.out}"):
        note(line)
