"""One ONNX graph on ONNX Runtime, NumPy arrays in and out. Nothing here imports torch."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from diff4splat.errors import FileFormatError, ShapeError
from diff4splat.models.onnx.manifest import (
    ADVICE,
    GraphEntry,
    Manifest,
    TensorSpec,
    read_manifest,
    require_files,
)
from diff4splat.models.onnx.session import open_session
from diff4splat.models.onnx.shapes import match_shape

Arrays = Mapping[str, np.ndarray]


class OnnxGraph:
    """A graph whose files were compared with the manifest; opened with the first run.

    Raises:
        FileFormatError: a file is not the one that was exported, or has no weights.
    """

    def __init__(
        self, folder: Path, manifest: Manifest, name: str, threads: int | None = None
    ) -> None:
        self.entry: GraphEntry = manifest.graph(name)
        if not manifest.weights_stored:
            raise FileFormatError(
                f"{folder}: expected graphs with weights, got shapes alone; {ADVICE}"
            )
        require_files(folder, self.entry.files)
        self.file = folder / self.entry.files[0].name
        self.threads = threads
        self._session = None

    def __call__(self, inputs: Arrays) -> dict[str, np.ndarray]:
        """Outputs by name.

        Raises:
            ShapeError: an input is absent, unknown, or of another type or shape.
            FileFormatError: ONNX Runtime cannot open the graph.
        """
        self._require(inputs)
        names = [spec.name for spec in self.entry.outputs]
        session = self._session or self._open()
        arrays = {name: np.ascontiguousarray(array) for name, array in inputs.items()}
        return dict(zip(names, session.run(names, arrays), strict=True))

    def _open(self) -> object:
        self._session = open_session(self.file, self.threads, ADVICE)
        return self._session

    def _require(self, inputs: Arrays) -> None:
        wanted = {spec.name: spec for spec in self.entry.inputs}
        if wanted.keys() != inputs.keys():
            raise ShapeError(
                f"{self.entry.name}: expected the inputs {', '.join(wanted)}, "
                f"got {', '.join(inputs) or 'none'}"
            )
        sizes: dict[str, int] = {}
        for name, spec in wanted.items():
            _require_dtype(self.entry.name, spec, inputs[name])
            match_shape(f"{self.entry.name}, {name}", spec.shape, inputs[name].shape, sizes)


class OnnxModel:
    """The graphs of a folder, without torch.

    Raises:
        FileFormatError: the folder holds no graphs, or a file beside them was changed.
    """

    def __init__(self, folder: Path | str, threads: int | None = None) -> None:
        self.folder, self.threads = Path(folder), threads
        self.manifest = read_manifest(self.folder)
        require_files(self.folder, self.manifest.files)
        self._graphs: dict[str, OnnxGraph] = {}

    def __getitem__(self, name: str) -> OnnxGraph:
        """The graph of that name; its files are compared with the manifest once."""
        if name not in self._graphs:
            self._graphs[name] = OnnxGraph(self.folder, self.manifest, name, self.threads)
        return self._graphs[name]


def _require_dtype(graph: str, spec: TensorSpec, array: np.ndarray) -> None:
    if array.dtype.name != spec.dtype:
        raise ShapeError(
            f"{graph}, {spec.name}: expected {spec.dtype}, got {array.dtype.name}; convert it"
        )
