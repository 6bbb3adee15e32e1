"""Variants of the reconstruction at equal compute: tables with intervals, and an image.

Run ``PYTHONPATH=benchmarks python -m ablations --run RUN --clips CLIPS --out OUT``, where RUN is a
training run whose autoencoder is over. ``--help`` lists the rest.
"""

import os
import sys

# Read once, when torch is loaded: threads that wait must sleep, or their seconds would count.
os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")

import tyro

from ablations.course import Lab, require_autoencoder, train_variant
from ablations.drawing import draw_differences
from ablations.evaluation import HeldOut, evaluate, held_out
from ablations.options import Options
from ablations.results import Row, store, stored_rows
from ablations.tables import to_json, to_markdown
from ablations.variants import STATIC, Variant, chosen_variants, recipe_of, reduced
from diff4splat.cli.common.console import ConsolePhases
from diff4splat.cli.common.installation import single_gaussian
from diff4splat.cli.common.precompile import precompile_renderer, precompile_sources
from diff4splat.errors import Diff4SplatError
from diff4splat.io.atomic import write_text
from diff4splat.io.figures.plots import require_matplotlib

BAD_INPUT, INTERRUPTED = 2, 130


def main() -> int:
    """The exit code; 2 after one line about what was asked for."""
    try:
        run(tyro.cli(Options, prog="ablations"))
    except Diff4SplatError as error:
        sys.stderr.write(f"ablations: {error}\n")
        return BAD_INPUT
    except KeyboardInterrupt:
        note("stopped; the same command goes on")
        return INTERRUPTED
    return 0


def run(options: Options) -> None:
    """Check everything cheap, then train and evaluate one variant after the other."""
    require_matplotlib()
    variants = chosen_variants(options.only)
    base = reduced(options.recipe(), options.steps)
    for variant in variants:
        recipe_of(variant, base)
    test_clips = held_out(base.stage(STATIC).data.size_px, options.items)
    autoencoder = require_autoencoder(options.run)
    phases = ConsolePhases()
    precompile_renderer(single_gaussian("cpu"), phases)
    drawn = [source for stage in base.stages for source in stage.data.sources]
    precompile_sources([test_clips.protocol.source, *drawn], phases)
    lab = Lab(base=base, autoencoder=autoencoder, out=options.out, note=note)
    for variant in variants:
        train_and_evaluate(variant, lab, test_clips)
        write(lab, test_clips)
    print(write(lab, test_clips))


def train_and_evaluate(variant: Variant, lab: Lab, test_clips: HeldOut) -> None:
    """One row of the table, kept in a file."""
    costs, folder = train_variant(variant, lab), lab.out / variant.name
    note(f"{variant.name}: evaluating")
    found = evaluate(variant, folder, test_clips, ConsolePhases())
    for failure in found.failures:
        note(f"{variant.name}: item {failure.item} ({failure.clip}) failed: {failure.why}")
    row = Row(title=variant.title, items=found.items, name=variant.name, costs=costs)
    store(row, folder, test_clips)


def write(lab: Lab, test_clips: HeldOut) -> str:
    """Tables and image of all that is evaluated so far; returns the Markdown."""
    rows = stored_rows(lab.out, test_clips)
    markdown = to_markdown(rows, lab.base, test_clips.protocol)
    write_text(lab.out / "ablations.md", markdown)
    write_text(lab.out / "ablations.json", to_json(rows, lab.base, test_clips.protocol))
    draw_differences(rows, test_clips.protocol, lab.out / "ablations.png")
    return markdown


def note(text: str) -> None:
    """One line of progress."""
    print(text, file=sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(main())
