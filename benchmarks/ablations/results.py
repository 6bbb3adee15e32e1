"""What is known of a variant once it is evaluated: a file per variant, and rows of the table.

OUT/<variant>/ablation.json     {"protocol": digest, "costs": […], "items": […]}
"""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from ablations.course import StageCost
from ablations.evaluation import HeldOut
from ablations.variants import VARIANTS
from diff4splat.evaluation.columns import SYSTEM, Column, column_of
from diff4splat.evaluation.protocols.protocol import Protocol
from diff4splat.evaluation.records import ItemResult, read_item
from diff4splat.evaluation.report.summary import Mean, interval
from diff4splat.evaluation.systems.baselines import BASELINES
from diff4splat.io.atomic import write_text

FILE = "ablation.json"
KEYS = (
    "psnr",
    "covisible_psnr",
    "depth_pearson",
    "track_error",
    "track_ratio",
    "moving_share",
)
COLUMNS: tuple[Column, ...] = tuple(column_of(key) for key in KEYS)


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One line of the table."""

    title: str
    items: tuple[ItemResult, ...]
    source: str = SYSTEM
    """Which row of the items: the system under test, or a baseline."""
    name: str = ""
    """Of the variant; baselines have none."""
    costs: tuple[StageCost, ...] = ()

    @property
    def steps(self) -> int:
        """Of all stages."""
        return sum(cost.steps for cost in self.costs)

    @property
    def cpu_s(self) -> float:
        """Of all stages."""
        return sum(cost.cpu_s for cost in self.costs)

    def values(self, key: str) -> dict[int, float]:
        """A measure per item, where there is one."""
        taken = {item.item: item.value(self.source, key) for item in self.items}
        return {item: value for item, value in taken.items() if value is not None}


def store(row: Row, folder: Path, held_out: HeldOut) -> None:
    """Keep what was found of a variant; items may be fewer than asked for, where some failed."""
    record = {
        "protocol": held_out.protocol.digest,
        "asked": held_out.items,
        "costs": [asdict(cost) for cost in row.costs],
        "items": [item.to_json() for item in row.items],
    }
    write_text(folder / FILE, json.dumps(record, allow_nan=False) + "\n")


def stored_rows(out: Path, held_out: HeldOut) -> list[Row]:
    """Variants evaluated on all these clips so far, in the order of the table, then baselines."""
    rows = []
    for variant in VARIANTS:
        record = _read(out / variant.name / FILE)
        if not _covers(record, held_out):
            continue
        items = tuple(read_item(item, variant.name) for item in record["items"])
        items = tuple(item for item in items if item.item < held_out.items)
        costs = tuple(StageCost(**cost) for cost in record["costs"])
        rows.append(Row(title=variant.title, items=items, name=variant.name, costs=costs))
    return rows + baseline_rows(rows[:1])


def baseline_rows(rows: Sequence[Row]) -> list[Row]:
    """The trivial answers of the same run; they depend on the clips alone."""
    return [Row(title=name, items=row.items, source=name) for row in rows for name in BASELINES]


def mean(row: Row, key: str, protocol: Protocol) -> Mean | None:
    """Over items, with its interval; None where nothing was measured."""
    values = list(row.values(key).values())
    return interval(values, protocol) if values else None


def difference(row: Row, full: Row, key: str, protocol: Protocol) -> Mean | None:
    """Row minus full, item by item, over items that have both."""
    own, other = row.values(key), full.values(key)
    values = [own[item] - other[item] for item in own if item in other]
    return interval(values, protocol) if values else None


def _covers(record: dict[str, Any], held_out: HeldOut) -> bool:
    """Means over other clips must not stand beside these."""
    same = record.get("protocol") == held_out.protocol.digest
    return same and record.get("asked", 0) >= held_out.items


def _read(file: Path) -> dict[str, Any]:
    return json.loads(file.read_text(encoding="utf-8")) if file.is_file() else {}
