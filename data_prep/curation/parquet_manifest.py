"""``manifest.parquet``: one row per clip, for tools that query tables; the only file with pyarrow.

Columns: names, licence and whether it allows commercial use, decision and reasons, checksum of the
stored clip with the version of scoring, and every score (float64) and label (text); what was not
measured is null. The JSON lines remain the record; this is a copy of them for reading.
"""

from pathlib import Path
from typing import Any

from diff4splat.data.licenses import commercial_ok
from diff4splat.data_prep.curation.clip_record import SCORING_VERSION, ClipRecord
from diff4splat.data_prep.curation.decisions import Decision
from diff4splat.errors import MissingExtraError
from diff4splat.io.atomic import atomic_path

FILE_NAME = "manifest.parquet"
_NOT_SHOWN = {"features"}
"""Labels that are no words."""


def require_parquet() -> Any:
    """The package, before anything is measured.

    Raises:
        MissingExtraError: pyarrow is not installed.
    """
    try:
        import pyarrow.parquet
    except ImportError as error:
        raise MissingExtraError(
            "--parquet: expected pyarrow, got an installation without it; "
            "pip install 'diff4splat[manifest]', or read scores.jsonl and decisions.csv"
        ) from error
    return pyarrow


def write_parquet(decisions: list[Decision], out: Path) -> Path:
    """Write the table whole or not at all; returns its file.

    Raises:
        MissingExtraError: pyarrow is not installed.
        OutputError: the folder cannot be written.
    """
    pyarrow = require_parquet()
    scores = sorted({name for each in decisions for name in each.record.scores})
    labels = sorted({name for each in decisions for name in each.record.labels} - _NOT_SHOWN)
    kinds = {"is_static": "bool_", "commercial_ok": "bool_", "selected": "bool_"}
    facts = _facts(Decision(record=ClipRecord(identifier="")))
    fields = [(name, getattr(pyarrow, kinds.get(name, "string"))()) for name in facts]
    fields += [(f"score_{name}", pyarrow.float64()) for name in scores]
    fields += [(f"label_{name}", pyarrow.string()) for name in labels]
    rows = [_row(each, scores, labels) for each in decisions]
    schema = pyarrow.schema(fields, {"scoring_version": str(SCORING_VERSION)})
    table = pyarrow.Table.from_pylist(rows, schema=schema)
    with atomic_path(out / FILE_NAME) as file:
        pyarrow.parquet.write_table(table, file, compression="zstd")
    return out / FILE_NAME


def _row(decision: Decision, scores: list[str], labels: list[str]) -> dict[str, Any]:
    record = decision.record
    return {
        **_facts(decision),
        **{f"score_{name}": record.scores.get(name) for name in scores},
        **{f"label_{name}": record.labels.get(name) for name in labels},
    }


def _facts(decision: Decision) -> dict[str, Any]:
    record = decision.record
    return {
        "folder": record.folder,
        "clip": record.identifier,
        "dataset": record.dataset,
        "scene": record.scene,
        "license": record.license,
        "commercial_ok": commercial_ok(record.license),
        "metric": record.metric,
        "is_static": record.is_static,
        "selected": decision.is_selected,
        "stage": decision.reasons[0].stage if decision.reasons else None,
        "reason": decision.reasons[0].text if decision.reasons else None,
        "detail": "; ".join(reason.detail for reason in decision.reasons) or None,
        "error": record.error or None,
        "checksum": record.checksum,
    }
