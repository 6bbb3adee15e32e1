"""Runs the experiments and writes a table: recovered numbers and images against baselines.

    python -m benchmarks.optics_fitting --out optics
    python -m benchmarks.optics_fitting --out optics --only lens focus

Experiments that are done are not done again.
"""

import argparse
import json
from pathlib import Path

from benchmarks.optics_fitting.experiments import EXPERIMENTS, Row


def main() -> None:
    options = _options()
    options.out.mkdir(parents=True, exist_ok=True)
    rows: list[Row] = []
    for name, run in EXPERIMENTS.items():
        file = options.out / f"{name}.json"
        if not file.exists() and (not options.only or name in options.only):
            print(name, flush=True)
            file.write_text(json.dumps(run(), indent=1))
        if file.exists():
            rows += json.loads(file.read_text())
    text = _table(rows)
    (options.out / "optics.md").write_text(text)
    print(text)


def _table(rows: list[Row]) -> str:
    """Markdown; what a row does not have is left out of it."""
    names = list(dict.fromkeys(name for row in rows for name in row))
    lines = ["| " + " | ".join(names) + " |", "|---" * len(names) + "|"]
    for row in rows:
        lines.append("| " + " | ".join(_cell(row.get(name, "")) for name in names) + " |")
    return "\n".join(lines) + "\n"


def _cell(value: str | float) -> str:
    return value if isinstance(value, str) else f"{value:.2f}"


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--only", nargs="*", default=[], choices=[*EXPERIMENTS, []])
    return parser.parse_args()


if __name__ == "__main__":
    main()
