"""Fits the worlds of ``fit_v1`` and writes a table: held-out quality, seconds, memory.

    python -m benchmarks.fitting --out fits                     # both motions and none
    python -m benchmarks.fitting --out fits --ablation          # parts of the field taken away
    python -m benchmarks.fitting --out fits --only rigid-0      # one world

Fits that are done are not done again; two calls on different worlds may run side by side.
"""

import argparse
import json
import subprocess
import sys
from pathlib import Path

from benchmarks.fitting.scenes import HELD_OUT, SCENES, FitScene, draw, mean_picture_db
from benchmarks.fitting.tables import table
from benchmarks.fitting.variants import ABLATIONS, VARIANTS
from diff4splat.progress.phases import Phases


def main() -> None:
    options = _options()
    variants = ABLATIONS if options.ablation else VARIANTS
    for scene in SCENES:
        if options.only and scene.name not in options.only:
            continue
        clips = draw(scene, options.out / "worlds", Phases())
        for variant, arguments in variants.items():
            if not options.variant or variant in options.variant:
                _fit(scene, variant, (*arguments, *options.more), clips, options.out)
    facts = {s.name: mean_picture_db(options.out / "worlds" / s.name) for s in SCENES
             if (options.out / "worlds" / s.name / "manifest.json").exists()}  # fmt: skip
    text = table(options.out, variants, facts)
    name = "ablation.md" if options.ablation else "fits.md"
    (options.out / name).write_text(text)
    print(text)


def _fit(scene: FitScene, variant: str, arguments: tuple[str, ...], clips: Path, out: Path) -> None:
    folder = out / scene.name / variant.replace(" ", "-")
    if (folder / "card.json").exists() and json.loads((folder / "card.json").read_text())[
        "finished"
    ]:
        return
    held = [str(view) for view in HELD_OUT]
    command = [sys.executable, "-m", "diff4splat.cli.main", "fit", str(clips), "--out", str(folder),
               "--hold-out", *held, *arguments]  # fmt: skip
    print(scene.name, variant, flush=True)
    subprocess.run(command, check=True)


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--ablation", action="store_true")
    parser.add_argument("--only", nargs="*", default=[])
    parser.add_argument("--variant", nargs="*", default=[])
    parser.add_argument("--more", nargs=argparse.REMAINDER, default=[])
    return parser.parse_args()


if __name__ == "__main__":
    main()
