"""A session of ONNX Runtime on a graph; the only importer of ONNX Runtime. Imports no torch.

ONNX Runtime collects no telemetry in its public builds for Python.
"""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from diff4splat.errors import FileFormatError


def open_session(file: Path, threads: int | None = None, advice: str = "download it again") -> Any:
    """A session on the CPU; ``threads`` is all that the process may use by default.

    Raises:
        FileFormatError: ONNX Runtime cannot open the graph.
    """
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads or len(os.sched_getaffinity(0))
    # Spinning threads take the cores that the renderer and other requests need.
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    options.log_severity_level = 3
    try:
        return onnxruntime.InferenceSession(str(file), options, providers=["CPUExecutionProvider"])
    except Exception as error:  # ONNX Runtime raises many types of its own
        raise FileFormatError(
            f"{file}: expected a graph that ONNX Runtime opens, got {error}; {advice}"
        ) from error


def run_session(
    session: Any, file: Path, inputs: Mapping[str, np.ndarray], outputs: Sequence[str]
) -> dict[str, np.ndarray]:
    """Outputs by name.

    Raises:
        FileFormatError: ONNX Runtime cannot run the graph on these inputs.
    """
    try:
        return dict(zip(outputs, session.run(list(outputs), dict(inputs)), strict=True))
    except Exception as error:
        shapes = ", ".join(f"{name} {list(array.shape)}" for name, array in inputs.items())
        raise FileFormatError(
            f"{file}: expected a graph that runs on {shapes}, got {error}; export it again"
        ) from error
