"""One part of a model as an ONNX graph, exported as the command does."""

import subprocess
import sys
from pathlib import Path
from typing import Any

from diff4splat.models.hub.model import Model, load_model, save_model

EXPORT = """
import sys
from pathlib import Path
from diff4splat.models.hub.model import load_model
from diff4splat.models.onnx_export.folder import ExportSettings, export_model
folder, part, *outputs = sys.argv[1:]
settings = ExportSettings(parts=(part,))
(row,) = export_model(load_model(Path(folder) / "model"), Path(folder) / "onnx", settings)
assert set(row.errors) == set(outputs)
assert max(row.errors.values()) < 1e-4
"""


def exported_part(model: Model, folder: Path, part: str, outputs: tuple[str, ...]) -> Any:
    """The part as a graph that ONNX Runtime runs; its outputs must be those."""
    save_model(model, folder / "model")
    # The exporter cannot trace checks of annotations, which this process has.
    subprocess.run([sys.executable, "-c", EXPORT, str(folder), part, *outputs], check=True)
    return getattr(load_model(folder / "onnx", parts=(part,)).networks, part)
