"""Make the gallery: ``make gallery``, or ``python -m examples.gallery --out gallery``.

The same command goes on after a stop; finished items are kept. ``--only`` names some of them.
"""

import argparse
import sys
from pathlib import Path

from examples.gallery.items import ITEMS
from examples.gallery.make import finished, make_all
from examples.gallery.page import write_page


def main() -> int:
    """Make what is missing, then the page; 1 if an item failed."""
    parser = argparse.ArgumentParser(prog="gallery", description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("gallery"))
    names = [item.name for item in ITEMS]
    parser.add_argument("--only", nargs="+", choices=names, default=names, metavar="NAME")
    options = parser.parse_args()
    gallery = options.out.resolve()
    gallery.mkdir(parents=True, exist_ok=True)
    asked = [item for item in ITEMS if item.name in options.only]
    made = make_all(asked, gallery, lambda line: print(line, flush=True))
    for item in ITEMS:
        if item.name not in made and (found := finished(item, gallery / item.name)) is not None:
            made[item.name] = found
    print(f"wrote {write_page(ITEMS, made, gallery)}: {len(made)} of {len(ITEMS)} items")
    return int(any(item.name not in made for item in asked))


if __name__ == "__main__":
    sys.exit(main())
