"""What an ONNX file says of itself, read from its names and shapes; its weights stay on disk.

Field numbers are those of ``onnx.proto`` (ONNX, IR version 3 and later).
"""

import mmap
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from diff4splat.errors import FileFormatError
from diff4splat.io.require_file import opened_file
from diff4splat.models.depth_priors.protobuf import Message

WHAT = "an ONNX graph"
ELEMENTS = {1: "float32", 6: "int32", 7: "int64", 9: "bool", 10: "float16", 11: "float64"}
"""Names of ``TensorProto.DataType``."""
_MOST_NODES, _MOST_DEPTH, _MOST_AXES = 1_000_000, 8, 16
Axis = int | None
"""A length, or None where it is free."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TensorFacts:
    """An input or output of a graph."""

    name: str
    dtype: str
    shape: tuple[Axis, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class NodeFacts:
    """One operation."""

    operator: str
    domain: str
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class GraphFacts:
    """Names, shapes, operators and references of a file; nothing of it was run."""

    inputs: tuple[TensorFacts, ...]
    outputs: tuple[TensorFacts, ...]
    nodes: tuple[NodeFacts, ...]
    weight_shapes: Mapping[str, tuple[int, ...]]
    external_files: frozenset[str]
    """Files of weights that the graph names."""
    functions: frozenset[tuple[str, str]]
    """(domain, name) of the functions that the file defines itself."""
    metadata: Mapping[str, str]


def read_graph_facts(file: Path) -> GraphFacts:
    """The facts of an ONNX file, in memory that its names bound.

    Raises:
        FileFormatError: no ONNX graph, or a damaged or cut off one.
    """
    with (
        opened_file(file, WHAT) as stream,
        mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as mapped,
        memoryview(mapped) as data,
    ):
        try:
            return _model_facts(Message(data, 0, len(data)))
        except FileFormatError as error:
            raise FileFormatError(f"{file}: {error}; download or export it again") from None


def _model_facts(model: Message) -> GraphFacts:
    graphs = list(model.messages(7))
    if len(graphs) != 1:
        raise FileFormatError(f"expected {WHAT}, got other data")
    graph, walk = graphs[0], _Walk()
    walk.graph(graph, 0)
    functions = list(model.messages(25))
    for function in functions:
        for node in function.messages(7):
            walk.node(node, 1)
    weights = set(walk.weight_shapes)
    inputs = tuple(_tensor(part) for part in graph.messages(11))
    return GraphFacts(
        inputs=tuple(one for one in inputs if one.name not in weights),
        outputs=tuple(_tensor(part) for part in graph.messages(12)),
        nodes=tuple(walk.nodes),
        weight_shapes=walk.weight_shapes,
        external_files=frozenset(walk.external),
        functions=frozenset((one.text(10), one.text(1)) for one in functions),
        metadata={one.text(1): one.text(2) for one in model.messages(14)},
    )


@dataclass(slots=True)
class _Walk:
    """Collects nodes and weights of a graph and of the graphs inside its nodes."""

    nodes: list[NodeFacts] = field(default_factory=list)
    weight_shapes: dict[str, tuple[int, ...]] = field(default_factory=dict)
    external: set[str] = field(default_factory=set)

    def graph(self, graph: Message, depth: int) -> None:
        if depth > _MOST_DEPTH:
            raise FileFormatError("expected a graph of few levels, got graphs inside of graphs")
        for number, value in graph:
            if number == 1 and isinstance(value, Message):
                self.node(value, depth)
            elif number == 5 and isinstance(value, Message):
                self.weight(value)
            elif number == 15 and isinstance(value, Message):
                for part in (*value.messages(1), *value.messages(2)):
                    self.weight(part)

    def node(self, node: Message, depth: int) -> None:
        if len(self.nodes) >= _MOST_NODES:
            raise FileFormatError(f"expected at most {_MOST_NODES:,} operations, got more")
        parts: dict[int, list[str]] = {1: [], 2: []}
        operator = domain = ""
        for number, value in node:
            if not isinstance(value, Message):
                continue
            if number in parts:
                parts[number].append(value.decoded())
            elif number == 4:
                operator = value.decoded()
            elif number == 7:
                domain = value.decoded()
            elif number == 5:
                self.attribute(value, depth)
        self.nodes.append(
            NodeFacts(
                operator=operator, domain=domain, inputs=tuple(parts[1]), outputs=tuple(parts[2])
            )
        )

    def attribute(self, attribute: Message, depth: int) -> None:
        for number, value in attribute:
            if not isinstance(value, Message):
                continue
            if number in (5, 10):
                self.weight(value)
            elif number in (6, 11):
                self.graph(value, depth + 1)
            elif number in (22, 23):
                for part in (*value.messages(1), *value.messages(2)):
                    self.weight(part)

    def weight(self, tensor: Message) -> None:
        name, shape = "", []
        for number, value in tensor:
            if number == 1:
                shape += [value] if isinstance(value, int) else list(value.numbers())
            elif number == 8 and isinstance(value, Message):
                name = value.decoded()
            elif number == 13 and isinstance(value, Message) and value.text(1) == "location":
                self.external.add(value.text(2))
        if len(shape) > _MOST_AXES:
            raise FileFormatError(f"expected weights of at most {_MOST_AXES} axes, got more")
        self.weight_shapes[name] = tuple(shape)


def _tensor(value: Message) -> TensorFacts:
    dtype, shape = "unknown", []
    for kind in value.messages(2):
        for tensor in kind.messages(1):
            dtype = ELEMENTS.get(tensor.number(1), "unknown")
            shape = [axis for part in tensor.messages(2) for axis in _axes(part)]
    return TensorFacts(name=value.text(1), dtype=dtype, shape=tuple(shape))


def _axes(shape: Message) -> Iterator[Axis]:
    for count, axis in enumerate(shape.messages(1)):
        if count == _MOST_AXES:
            raise FileFormatError(f"expected tensors of at most {_MOST_AXES} axes, got more")
        yield axis.number(1) or None
