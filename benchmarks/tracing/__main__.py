"""Our tracer against Mitsuba 3: seconds per image and how alike the images are.

    pip install mitsuba==3.7.1                                # and a libLLVM that it finds
    python -m benchmarks.tracing --out tracing                # all cores
    python -m benchmarks.tracing --out tracing --threads 1

Both look along the same rays with Mitsuba's rules, except that it orders hits by where rays enter
the ellipsoids and we by where they peak. Repeats take turns.
"""

import argparse
import os
from pathlib import Path

import torch

from benchmarks.renderers.timing.machine import Disturbance, this_machine
from benchmarks.tracing import mitsuba_tracer
from benchmarks.tracing.measuring import measure
from benchmarks.tracing.scenes import SCENES
from benchmarks.tracing.tables import as_json, markdown


def main() -> None:
    options = _options()
    torch.set_num_threads(options.threads)
    mitsuba_tracer.start(options.threads)
    disturbance = Disturbance()
    rows = [measure(scene, options.repeats) for scene in SCENES]
    machine = (
        f"{this_machine()}; {options.threads} threads, {options.repeats} repeats, "
        f"others used {disturbance.cores():.2f} cores"
    )
    text = markdown(rows, machine)
    options.out.mkdir(parents=True, exist_ok=True)
    (options.out / "tracing.md").write_text(text)
    (options.out / "tracing.json").write_text(as_json(rows, machine))
    print(text)


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--threads", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--repeats", type=int, default=7)
    return parser.parse_args()


if __name__ == "__main__":
    main()
