"""The Parquet manifest holds what the JSON lines and decisions hold."""

import sys
from pathlib import Path

import pytest

from diff4splat.data_prep.curation.clip_record import ClipRecord
from diff4splat.data_prep.curation.decisions import Decision, Reason
from diff4splat.data_prep.curation.parquet_manifest import require_parquet, write_parquet
from diff4splat.errors import MissingExtraError

RECORDS = [
    ClipRecord(
        identifier="a",
        folder="part-0",
        dataset="spring",
        license="CC-BY-4.0",
        scores={"flow_mean": 0.25, "tracks_reliable": 300.0},
        labels={"motion": "slow", "features": "AAAA"},
        checksum="c1",
    ),
    ClipRecord(identifier="b", license="CC-BY-NC-4.0", scores={"flow_mean": 0.5}),
]
REASON = Reason(stage="motion", text="frozen", detail="flow_p90 0, expected at least 0.002")


def test_every_clip_is_a_row(tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet", reason="needs diff4splat[manifest]")
    decisions = [Decision(record=RECORDS[0]), Decision(record=RECORDS[1], reasons=(REASON,))]
    file = write_parquet(decisions, tmp_path)
    first, second = parquet.read_table(file).to_pylist()
    assert first["selected"] is True and second["selected"] is False
    assert (first["commercial_ok"], second["commercial_ok"]) == (True, False)
    assert first["score_flow_mean"] == 0.25 and second["score_tracks_reliable"] is None
    assert first["label_motion"] == "slow" and "label_features" not in first
    assert second["reason"] == "frozen" and "expected at least 0.002" in second["detail"]
    assert parquet.read_schema(file).metadata[b"scoring_version"]
    before = file.read_bytes()
    assert write_parquet(decisions, tmp_path).read_bytes() == before
    assert parquet.read_table(write_parquet([], tmp_path)).num_rows == 0


def test_without_the_package_it_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    monkeypatch.setitem(sys.modules, "pyarrow.parquet", None)
    with pytest.raises(MissingExtraError, match=r"expected pyarrow, .*\[manifest\]"):
        require_parquet()
