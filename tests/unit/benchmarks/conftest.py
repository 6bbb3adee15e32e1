"""Benchmarks are not installed: what their commands put on the path is put there.

The harness of renderers is a folder, not a package; ``ablations`` is a package beside it.
Shapes are checked here as those of the library are.
"""

import sys
from pathlib import Path

import jaxtyping

HARNESS = Path(__file__).parents[3] / "benchmarks" / "renderers"
sys.path[:0] = [str(HARNESS), str(HARNESS.parent)]
SHAPED = ("ablations", "ground_truth", "scenes", "torch_backward")
jaxtyping.install_import_hook(SHAPED, "type_checks.check_types")
