"""The harness is a folder, not a package: ``python benchmarks/renderers`` puts it on the path.

Shapes are checked here as those of the library are.
"""

import sys
from pathlib import Path

import jaxtyping

HARNESS = Path(__file__).parents[3] / "benchmarks" / "renderers"
sys.path.insert(0, str(HARNESS))
SHAPED = ("brute_force", "comparison", "sampling", "scenes", "torch_backward")
jaxtyping.install_import_hook(SHAPED, "beartype.beartype")
