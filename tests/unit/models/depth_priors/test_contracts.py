"""Which contract a graph has, by its names, shapes, first layer and metadata."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
import small_onnx

from diff4splat.errors import FileFormatError
from diff4splat.models.depth_priors.contracts import (
    HALF,
    IMAGENET,
    METADATA,
    PLAIN,
    DepthContract,
    recognise,
)
from diff4splat.models.depth_priors.graph_facts import GraphFacts, TensorFacts, read_graph_facts

IMAGE = TensorFacts(name="pixel_values", dtype="float32", shape=(1, 3, None, None))
EMPTY = GraphFacts(
    inputs=(IMAGE,), outputs=(), nodes=(), weight_shapes={}, external_files=frozenset(),
    functions=frozenset(), metadata={},
)  # fmt: skip


def found(file: Path) -> DepthContract:
    return recognise(file, read_graph_facts(file))


def with_outputs(*names: str) -> GraphFacts:
    outputs = tuple(TensorFacts(name=name, dtype="float32", shape=()) for name in names)
    return replace(EMPTY, outputs=outputs)


@pytest.mark.parametrize("names", [("pixel_values", "predicted_depth"), ("image", "depth")])
def test_depth_anything_has_patches_of_14(tmp_path: Path, names: tuple[str, str]) -> None:
    contract = found(small_onnx.one_map(tmp_path / "a.onnx", 14, names))
    assert (contract.family, contract.kind, contract.multiple_px) == (
        "Depth Anything", "inverse", 14,
    )  # fmt: skip
    assert (contract.mean, contract.std) == IMAGENET


def test_dpt_has_patches_of_16(tmp_path: Path) -> None:
    contract = found(small_onnx.one_map(tmp_path / "a.onnx", 16))
    assert (contract.family, contract.kind, contract.side_px) == ("DPT", "inverse", 384)
    assert (contract.mean, contract.std) == HALF


def test_midas_is_a_square_of_256_and_may_normalise_itself(tmp_path: Path) -> None:
    names, sides = ("0", "797"), (256, 256)
    plain = found(small_onnx.one_map(tmp_path / "a.onnx", 4, names, sides))
    inside = found(small_onnx.one_map(tmp_path / "b.onnx", 4, names, sides, normalised=True))
    assert (plain.family, plain.kind, plain.square) == ("MiDaS", "inverse", True)
    assert (plain.mean, plain.std) == IMAGENET
    assert (inside.mean, inside.std) == PLAIN


def test_depth_pro_by_its_field_of_view() -> None:
    ours = recognise(Path("a"), with_outputs("predicted_depth", "field_of_view"))
    other = recognise(Path("a"), with_outputs("predicted_depth", "focallength_px"))
    assert (ours.family, ours.kind, ours.fov) == ("Depth Pro", "metric", "field_of_view")
    assert (other.family, other.kind, other.fov) == ("Depth Pro", "metric", "")


def test_moge_by_its_points() -> None:
    for scale in ("metric_scale", "scale"):
        contract = recognise(Path("a"), with_outputs("points", "normal", "mask", scale))
        assert (contract.family, contract.kind, contract.scale) == ("MoGe", "metric", scale)


def test_depth_anything_3_by_its_views_or_cameras() -> None:
    views = replace(IMAGE, shape=(1, None, 3, None, None))
    facts = replace(with_outputs("predicted_depth", "intrinsics"), inputs=(views,))
    assert recognise(Path("a"), facts).kind == "relative"
    assert recognise(Path("a"), with_outputs("depth", "sky")).family == "Depth Anything 3"


def test_metadata_states_any_contract(tmp_path: Path) -> None:
    stated = {"family": "mine", "input": "x", "output": "y", "kind": "distance", "mean": [0, 0, 0]}
    metadata = {METADATA: json.dumps(stated)}
    contract = found(small_onnx.one_map(tmp_path / "a.onnx", 3, ("x", "y"), metadata=metadata))
    assert (contract.family, contract.kind) == ("mine", "distance")


@pytest.mark.parametrize(
    "stated",
    ["{", "[]", '{"kind": "depth"}', '{"family": "a", "input": "other", "output": "y", "kind": 1}'],
)
def test_wrong_metadata_is_refused(tmp_path: Path, stated: str) -> None:
    file = small_onnx.one_map(tmp_path / "a.onnx", 3, ("x", "y"), metadata={METADATA: stated})
    with pytest.raises(FileFormatError, match="expected a contract"):
        found(file)


@pytest.mark.parametrize(
    "facts",
    [
        with_outputs("logits"),
        replace(with_outputs("predicted_depth"), inputs=()),
        replace(with_outputs("predicted_depth"), inputs=(IMAGE, replace(IMAGE, name="second"))),
        replace(EMPTY, inputs=(replace(IMAGE, shape=(1, 5, None, None)),)),
    ],
)
def test_unknown_graphs_are_refused_with_what_they_have(facts: GraphFacts) -> None:
    with pytest.raises(FileFormatError, match=r"expected a depth network.*got inputs"):
        recognise(Path("a.onnx"), facts)
