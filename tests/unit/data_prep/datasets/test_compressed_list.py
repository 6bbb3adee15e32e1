"""A small compressed list costs little memory, whatever its largest size may be."""

import gzip
import json
import tracemalloc
from pathlib import Path

from diff4splat.data_prep.datasets.dynamic_replica import _grouped

MOST_BYTES = 100 << 20


def test_a_small_list_reserves_no_room_for_the_largest(tmp_path: Path) -> None:
    file = tmp_path / "frame_annotations_test.jgz"
    entries = [{"sequence_name": "a_source_left", "frame_number": n} for n in range(3)]
    file.write_bytes(gzip.compress(json.dumps(entries).encode()))
    tracemalloc.start()
    try:
        grouped = _grouped(file)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert sum(len(each) for eyes in grouped.values() for each in eyes.values()) == 3
    assert peak < MOST_BYTES
