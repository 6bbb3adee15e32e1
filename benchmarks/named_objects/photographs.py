"""Whether objects of photographs are found: ``python -m benchmarks.named_objects.photographs``.

Four photographs of scikit-image, or with ``--opencv FOLDER`` eight of OpenCV's samples (Debian
package ``opencv-doc``, folder ``data``), with outlines drawn by hand (``photographs.json``).
Columns as in ``benchmarks.named_objects``; the image shows what moves, for every sentence and
model.
"""

import argparse
import json
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import skimage.data
import torch
from torch import Tensor

from benchmarks.named_objects.__main__ import (
    COLUMNS,
    THRESHOLD,
    collect,
    means,
    measure,
    motion_of,
    without_classifier,
)
from diff4splat.errors import InputError
from diff4splat.generation.plan import MOTION_PARTS
from diff4splat.io.photos.images import read_photo, write_png
from diff4splat.io.pixels import to_bytes, unit_rgb
from diff4splat.models.hub.model import Model, load_model

OUTLINES = Path(__file__).with_name("photographs.json")
OPENCV_OUTLINES = Path(__file__).with_name("opencv_photographs.json")
SHORT_SIDE_PX, MULTIPLE_PX = 128, 16
TILE_PX, DARK, PER_ROW = (160, 224), 0.2, 3


@dataclass(frozen=True, slots=True, kw_only=True)
class Asked:
    """A photograph, a name, and the pixels of its object; none for an absent one."""

    photograph: str
    name: str
    rgb: Tensor
    truth: Tensor

    @property
    def sentence(self) -> str:
        """The prompt."""
        return f"the {self.name} moves to the left"


def all_asked(opencv: Path | None = None) -> list[Asked]:
    """Every name of every photograph; of those in a folder of OpenCV's samples, if it is given."""
    outlines = OPENCV_OUTLINES if opencv else OUTLINES
    asked = []
    for photograph, content in json.loads(outlines.read_text(encoding="utf-8")).items():
        rgb = reduced(_pixels(photograph, opencv))
        nothing = torch.zeros(rgb.shape[:2], dtype=torch.bool)
        named = {
            name: outlined(one["outline"], rgb)
            for one in content["objects"].values()
            for name in one["names"]
        }
        for name, truth in (named | dict.fromkeys(content["absent"], nothing)).items():
            asked.append(Asked(photograph=photograph, name=name, rgb=rgb, truth=truth))
    return asked


def _pixels(photograph: str, opencv: Path | None) -> np.ndarray:
    if opencv is None:
        return getattr(skimage.data, photograph)()
    return to_bytes(read_photo(opencv / photograph, convert=True).rgb)


def reduced(image: np.ndarray) -> Tensor:
    """As large as networks see it."""
    scale = SHORT_SIDE_PX / min(image.shape[:2])
    height, width = (round(scale * side / MULTIPLE_PX) * MULTIPLE_PX for side in image.shape[:2])
    small = cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA)
    return unit_rgb(torch.from_numpy(small))


def outlined(outline: list[list[float]], rgb: Tensor) -> Tensor:
    """Pixels within a polygon, whose corners are shares of width and height."""
    height, width = rgb.shape[:2]
    corners = np.round(np.array(outline) * [width, height] - 0.5).astype(np.int32)
    return torch.from_numpy(cv2.fillPoly(np.zeros((height, width), np.uint8), [corners], 1)) > 0


def row(model: Model, asked: list[Asked]) -> tuple[dict[str, float], list[np.ndarray]]:
    """Means over all sentences, and what moves for each."""
    values: dict[str, list[float]] = defaultdict(list)
    tiles = []
    for one in asked:
        sample = motion_of(model, one.rgb, one.sentence)
        collect(values, sample, one.truth)
        measured = {key: round(value, 2) for key, value in measure(sample, one.truth).items()}
        print(f"  {one.photograph}, {one.name}:", measured)
        tiles.append(tile(one, sample.mask(THRESHOLD)))
    return means(values), tiles


def tile(one: Asked, mask: Tensor) -> np.ndarray:
    """The photograph with all else dark, and the name."""
    shown = one.rgb * torch.where(mask, 1.0, DARK)[..., None]
    shown = cv2.resize((shown.numpy() * 255).astype(np.uint8), TILE_PX[::-1])
    return cv2.putText(shown, one.name, (4, 14), 0, 0.42, (255, 255, 255), 1, cv2.LINE_AA)


@torch.no_grad()
def main() -> None:
    """Print a table, and write the image: a row of ``PER_ROW`` names, all models of each."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("models", nargs="+")
    parser.add_argument("--out", type=Path)
    parser.add_argument("--opencv", type=Path)
    parser.add_argument("--without-classifier", action="store_true")
    options = parser.parse_args()
    try:
        asked, columns = all_asked(options.opencv), []
    except InputError as error:
        parser.error(f"--opencv: {error}")
    lines = ["| model |" + " | ".join(COLUMNS) + " |", "|---|" + "---:|" * len(COLUMNS)]
    for name in options.models:
        model = load_model(name, parts=MOTION_PARTS)
        model = without_classifier(model) if options.without_classifier else model
        values, tiles = row(model, asked)
        columns.append(tiles)
        lines.append(f"| {name} | " + " | ".join(f"{values[c]:.3f}" for c in COLUMNS) + " |")
    print("\n".join(lines))
    if options.out:
        groups = [np.concatenate(group, 1) for group in zip(*columns, strict=True)]
        groups += [np.zeros_like(groups[0])] * (-len(groups) % PER_ROW)
        rows = [np.concatenate(groups[k : k + PER_ROW], 1) for k in range(0, len(groups), PER_ROW)]
        write_png(unit_rgb(torch.from_numpy(np.concatenate(rows))), options.out)


if __name__ == "__main__":
    main()
