"""A graph of ONNX operators that is built by hand: no tracing, equal scenes give equal bytes."""

from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor

from diff4splat import __version__
from diff4splat.errors import InputError
from diff4splat.io.onnx_package import onnx_package

OPSET, IR_VERSION = 18, 9
MAX_BYTES = (1 << 31) - (1 << 20)
"""Of one file; protocol buffers cannot be longer."""


class GraphBuilder:
    """Operators and constants; values are referred to by name."""

    def __init__(self) -> None:
        self._onnx = onnx_package()
        self.nodes: list = []
        self.constants: dict[str, np.ndarray] = {}

    def constant(self, name: str, value: Tensor | Sequence[int]) -> str:
        """A stored array, float32 or int64."""
        array = value.detach().cpu().numpy() if isinstance(value, Tensor) else np.array(value)
        kind = np.float32 if array.dtype.kind == "f" else np.int64
        self.constants[name] = np.ascontiguousarray(array, kind)
        return name

    def add(self, operator: str, *inputs: str, **attributes: object) -> str:
        """One operator with one output."""
        output = f"{operator.lower()}_{len(self.nodes)}"
        make = self._onnx.helper.make_node
        self.nodes.append(make(operator, list(inputs), [output], **attributes))
        return output

    def name_output(self, value: str, name: str) -> None:
        """Give a value the name that callers know."""
        self.nodes.append(self._onnx.helper.make_node("Identity", [value], [name]))

    def serialized(self, outputs: dict[str, tuple[int, ...]], notes: dict[str, str]) -> bytes:
        """The model with input ``time_s`` (1) and the named outputs of these shapes.

        Raises:
            InputError: it would be larger than a file can be.
        """
        size = sum(array.nbytes for array in self.constants.values())
        if size > MAX_BYTES:
            raise InputError(
                f"ONNX: expected at most 2 GiB, got {size / 2**30:.1f} GiB; use fewer key times"
            )
        helper, real = self._onnx.helper, self._onnx.TensorProto.FLOAT
        info = helper.make_tensor_value_info
        graph = helper.make_graph(
            self.nodes,
            "scene",
            [info("time_s", real, [1])],
            [info(name, real, shape) for name, shape in outputs.items()],
            [self._onnx.numpy_helper.from_array(a, n) for n, a in self.constants.items()],
        )
        model = helper.make_model(
            graph,
            opset_imports=[helper.make_opsetid("", OPSET)],
            ir_version=IR_VERSION,
            producer_name="diff4splat",
            producer_version=__version__,
        )
        helper.set_model_props(model, notes)
        return model.SerializeToString()


def moments(builder: GraphBuilder, name: str, value: Tensor) -> str:
    """A constant in float32."""
    return builder.constant(name, value.to(torch.float32))
