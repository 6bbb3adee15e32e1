"""What is read of an ONNX file, and what of it is refused before ONNX Runtime sees it."""

import re
import tracemalloc
from pathlib import Path

import numpy as np
import onnx
import pytest
import small_onnx
from hypothesis import given, settings
from hypothesis import strategies as st
from onnx import helper

from diff4splat.errors import FileFormatError
from diff4splat.models.depth_priors.graph_facts import GraphFacts, read_graph_facts
from diff4splat.models.depth_priors.graph_safety import require_safe


def checked(file: Path) -> GraphFacts:
    facts = read_graph_facts(file)
    require_safe(file, facts)
    return facts


def test_names_shapes_and_operators_are_those_of_onnx(tmp_path: Path) -> None:
    file = small_onnx.one_map(tmp_path / "a.onnx", metadata={"key": "value"})
    facts, model = read_graph_facts(file), onnx.load(file)
    assert [one.name for one in facts.inputs] == [one.name for one in model.graph.input]
    assert facts.inputs[0].shape == (1, 3, None, None) and facts.inputs[0].dtype == "float32"
    assert [one.operator for one in facts.nodes] == [one.op_type for one in model.graph.node]
    assert facts.weight_shapes["kernel"] == (1, 3, 14, 14)
    assert facts.metadata == {"key": "value"}


def test_weights_are_not_taken_into_memory(tmp_path: Path) -> None:
    file = small_onnx.constant(tmp_path / "a.onnx", np.zeros((1, 2000, 2000)))
    tracemalloc.start()
    read_graph_facts(file)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert file.stat().st_size > 16e6 and peak < 2e6


def test_nodes_inside_of_nodes_are_found(tmp_path: Path) -> None:
    branch = helper.make_graph(
        [helper.make_node("Strange", ["a"], ["b"], domain="custom.ops")], "branch", [], []
    )
    node = helper.make_node("If", ["condition"], ["b"], then_branch=branch, else_branch=branch)
    graph = helper.make_graph([node], "g", [small_onnx.tensor("a", [1])], [])
    (tmp_path / "a.onnx").write_bytes(helper.make_model(graph).SerializeToString())
    with pytest.raises(FileFormatError, match=r"Strange of custom\.ops"):
        checked(tmp_path / "a.onnx")


def test_functions_of_the_file_itself_are_allowed(tmp_path: Path) -> None:
    opset = helper.make_opsetid("", 17)
    function = helper.make_function(
        "own", "Twice", ["a"], ["b"], [helper.make_node("Add", ["a", "a"], ["b"])], [opset]
    )
    graph = helper.make_graph(
        [helper.make_node("Twice", ["a"], ["b"], domain="own")],
        "g", [small_onnx.tensor("a", [1])], [small_onnx.tensor("b", [1])],
    )  # fmt: skip
    model = helper.make_model(graph, functions=[function], opset_imports=[opset])
    (tmp_path / "a.onnx").write_bytes(model.SerializeToString())
    assert ("own", "Twice") in checked(tmp_path / "a.onnx").functions


@pytest.mark.parametrize("name", ["../secret", "/etc/hostname", "sub/../../secret"])
def test_weights_outside_of_the_folder_are_refused(tmp_path: Path, name: str) -> None:
    (tmp_path / "secret").write_bytes(bytes(16))
    folder = tmp_path / "model"
    (folder / "sub").mkdir(parents=True)
    file = small_onnx.with_external_weights(folder / "a.onnx", name)
    with pytest.raises(FileFormatError, match="outside of its folder"):
        checked(file)


def test_a_link_that_leaves_the_folder_is_refused(tmp_path: Path) -> None:
    (tmp_path / "secret").write_bytes(bytes(16))
    folder = tmp_path / "model"
    folder.mkdir()
    (folder / "weights").symlink_to(tmp_path / "secret")
    file = small_onnx.with_external_weights(folder / "a.onnx", "weights")
    with pytest.raises(FileFormatError, match="outside of its folder"):
        checked(file)


def test_absent_weights_are_named(tmp_path: Path) -> None:
    file = small_onnx.with_external_weights(tmp_path / "a.onnx", "a.onnx_data")
    with pytest.raises(FileFormatError, match=r"weights in 'a\.onnx_data'.*download that file too"):
        checked(file)


def test_every_cut_off_file_is_refused_or_lacks_its_end(tmp_path: Path) -> None:
    file = small_onnx.one_map(tmp_path / "a.onnx")
    content = file.read_bytes()
    refused = 0
    for stop in range(1, len(content) - 1, 37):
        file.write_bytes(content[:stop])
        try:
            read_graph_facts(file)
        except FileFormatError as error:
            assert str(file) in str(error)
            refused += 1
    assert refused > 10


@settings(max_examples=200, deadline=None)
@given(content=st.binary(min_size=1, max_size=200))
def test_other_data_never_ends_in_another_error(
    tmp_path_factory: pytest.TempPathFactory, content: bytes
) -> None:
    file = tmp_path_factory.getbasetemp() / "random.onnx"
    file.write_bytes(content)
    with pytest.raises(FileFormatError, match=re.escape(str(file))):
        checked(file)


def test_graphs_inside_of_graphs_end(tmp_path: Path) -> None:
    graph = helper.make_graph([], "inner", [], [])
    for _ in range(20):
        graph = helper.make_graph([helper.make_node("If", [], [], then_branch=graph)], "g", [], [])
    (tmp_path / "a.onnx").write_bytes(helper.make_model(graph).SerializeToString())
    with pytest.raises(FileFormatError, match="graphs inside of graphs"):
        read_graph_facts(tmp_path / "a.onnx")
