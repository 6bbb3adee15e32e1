"""The graphs of an ONNX model for inference requests; imports no torch."""

from dataclasses import dataclass, field
from pathlib import Path
from threading import Lock

import numpy as np

from diff4splat.models.onnx.graph import OnnxModel
from diff4splat.models.onnx.manifest import GraphEntry, has_graphs


@dataclass(slots=True, kw_only=True)
class ServedGraphs:
    """Graphs by name; none for a model of PyTorch weights."""

    model: OnnxModel | None
    _lock: Lock = field(default_factory=Lock)

    @classmethod
    def open(cls, model: str) -> "ServedGraphs":
        """The graphs of a folder, if it is one of graphs.

        Raises:
            FileFormatError: the folder is damaged.
        """
        folder = Path(model)
        return cls(model=OnnxModel(folder) if has_graphs(folder) else None)

    @property
    def entries(self) -> dict[str, GraphEntry]:
        """What each graph takes and gives."""
        if self.model is None:
            return {}
        return {entry.name: entry for entry in self.model.manifest.graphs}

    def run(self, name: str, inputs: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Outputs of one graph; one request at a time, so that memory has a bound."""
        with self._lock:
            return self.model[name](inputs)
