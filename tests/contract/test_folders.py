"""A folder holds as many modules as a reader can survey."""

from collections import Counter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PACKAGES = ("diff4splat", "models", "training", "data_prep", "configs", "benchmarks")
MOST_MODULES = 15


@pytest.mark.parametrize("package", PACKAGES)
def test_no_folder_is_crowded(package: str) -> None:
    files = [file for file in (ROOT / package).rglob("*.py") if file.stem != "__init__"]
    counts = Counter(file.parent.relative_to(ROOT) for file in files)
    assert counts
    assert not {folder: count for folder, count in counts.items() if count > MOST_MODULES}
