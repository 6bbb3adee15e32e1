"""The harness is a folder, not a package: ``python benchmarks/renderers`` puts it on the path.

Its shapes are checked here as those of the library are.
"""

import sys
from pathlib import Path

import jaxtyping

HARNESS = Path(__file__).parents[3] / "benchmarks" / "renderers"
sys.path.insert(0, str(HARNESS))
jaxtyping.install_import_hook([file.stem for file in HARNESS.glob("*.py")], "beartype.beartype")
