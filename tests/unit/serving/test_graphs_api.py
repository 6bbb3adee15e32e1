"""The inference protocol: a graph described and evaluated, and every tensor that it refuses."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from echo_server import WORKER, settings
from fastapi.testclient import TestClient

from diff4splat.models.config.sizes import size_by_name
from diff4splat.models.onnx.manifest import (
    GraphEntry,
    Manifest,
    TensorSpec,
    file_entry,
    write_manifest,
)
from diff4splat.serving.api.app import create_app

onnx = pytest.importorskip("onnx", reason="needs the extra onnx")


def write_graph(folder: Path) -> None:
    """One graph: its input and twice its input."""
    from onnx import TensorProto, helper

    shape = ["batch", 2]
    x = helper.make_tensor_value_info("x", TensorProto.FLOAT, shape)
    y = helper.make_tensor_value_info("y", TensorProto.FLOAT, shape)
    graph = helper.make_graph([helper.make_node("Add", ["x", "x"], ["y"])], "double", [x], [y])
    opset = [helper.make_opsetid("", 20)]
    onnx.save(helper.make_model(graph, opset_imports=opset, ir_version=10), folder / "double.onnx")
    spec = {"dtype": "float32", "shape": ("batch", 2)}
    entry = GraphEntry(
        name="double",
        part="dit",
        files=(file_entry(folder / "double.onnx"),),
        inputs=(TensorSpec(name="x", **spec),),
        outputs=(TensorSpec(name="y", **spec),),
    )
    (folder / "config.json").write_text(size_by_name("test").to_json())
    manifest = Manifest(
        model="test",
        precision="float32",
        opset=20,
        license="Apache-2.0",
        exported_with={},
        parameter_counts={},
        files=(file_entry(folder / "config.json"),),
        graphs=(entry,),
    )
    write_manifest(manifest, folder)


@pytest.fixture
def client(tmp_path: Path) -> Iterator[TestClient]:
    write_graph(tmp_path)
    given = settings(tmp_path / "serve", infer_elements=100)
    from dataclasses import replace

    with TestClient(create_app(replace(given, model=str(tmp_path)), WORKER)) as client:
        yield client


def tensor(**changes: object) -> dict:
    return {"name": "x", "shape": [2, 2], "datatype": "FP32", "data": [1, 2, 3, 4.5]} | changes


def infer(client: TestClient, **changes: object) -> object:
    return client.post("/v2/models/double/infer", json={"id": "7", "inputs": [tensor(**changes)]})


def test_a_graph_is_described(client: TestClient) -> None:
    found = client.get("/v2/models/double").json()
    assert found["inputs"] == [{"name": "x", "datatype": "FP32", "shape": [-1, 2]}]
    assert client.get("/v2/models/double/ready").json() == {"ready": True}
    assert client.get("/v2/models/other").status_code == 404


@pytest.mark.parametrize("data", [[1, 2, 3, 4.5], [[1, 2], [3, 4.5]]])
def test_a_graph_is_evaluated(client: TestClient, data: list) -> None:
    answer = infer(client, data=data)
    assert answer.status_code == 200
    found = answer.json()
    assert found["id"] == "7" and found["outputs"][0]["data"] == [2, 4, 6, 9]
    assert np.prod(found["outputs"][0]["shape"]) == 4


@pytest.mark.parametrize(
    ("changes", "status", "expected"),
    [
        ({"data": [1, 2, 3]}, 400, "inputs.x.data: expected FP32 of shape"),
        ({"data": ["a", 2, 3, 4]}, 400, "inputs.x.data"),
        ({"data": [[1], 2, 3, 4]}, 400, "inputs.x.data"),
        ({"data": [None, 2, 3, 4]}, 400, "inputs.x.data"),
        ({"data": [1e39, 2, 3, 4]}, 400, "inputs.x.data"),
        ({"data": [3e38, 2, 3, 4]}, 400, "outputs.y: not finite"),
        ({"shape": [-2, -2]}, 400, "inputs.0.shape.0"),
        ({"shape": [4, 1]}, 400, "expected the shape"),
        ({"shape": [4]}, 400, "expected the shape"),
        ({"shape": [1 << 24, 1 << 24]}, 413, "at most 100 numbers"),
        ({"shape": [0, 2], "data": []}, 400, "expected the shape"),
        ({"datatype": "BYTES"}, 400, "inputs.0.datatype"),
        ({"datatype": "INT64", "data": [1, 2, 3, 4]}, 400, "expected float32, got int64"),
        ({"name": "z"}, 400, "expected the inputs x, got z"),
    ],
)
def test_tensors_are_refused(client: TestClient, changes: dict, status: int, expected: str) -> None:
    answer = infer(client, **changes)
    assert answer.status_code == status and expected in answer.text


@pytest.mark.parametrize("body", [b"", b"{", b"[]", b'{"inputs": 3}', b"\xff", b'{"inputs": []}'])
def test_bodies_are_refused(client: TestClient, body: bytes) -> None:
    assert client.post("/v2/models/double/infer", content=body).status_code == 400


def test_a_long_body_is_refused(client: TestClient) -> None:
    assert client.post("/v2/models/double/infer", content=b" " * 10_000).status_code == 413


def post_bytes(
    client: TestClient, content: bytes, size: int | None, **parameters: object
) -> object:
    import json

    inputs = tensor(data=None, parameters={"binary_data_size": size})
    text = json.dumps({"inputs": [inputs], "parameters": parameters}).encode()
    headers = {"Inference-Header-Content-Length": str(len(text))}
    return client.post("/v2/models/double/infer", content=text + content, headers=headers)


def test_tensors_as_bytes(client: TestClient) -> None:
    values = np.array([1, 2, 3, np.pi], "<f4")
    answer = post_bytes(client, values.tobytes(), 16, binary_data_output=True)
    length = int(answer.headers["inference-header-content-length"])
    assert answer.status_code == 200
    assert np.array_equal(np.frombuffer(answer.content[length:], "<f4"), 2 * values)
    assert b'"binary_data_size":16' in answer.content[:length]
    assert client.get("/v2").json()["extensions"] == ["binary_tensor_data"]


@pytest.mark.parametrize(
    ("content", "size"),
    [(b"", 16), (b"x" * 12, 12), (b"x" * 20, 16), (b"\xff" * 16, 16), (b"x" * 16, 20)],
)
def test_other_bytes_are_refused(client: TestClient, content: bytes, size: int) -> None:
    assert post_bytes(client, content, size).status_code == 400


@pytest.mark.parametrize("length", ["-1", "99999", "x", ""])
def test_a_wrong_length_of_the_json_is_refused(client: TestClient, length: str) -> None:
    headers = {"Inference-Header-Content-Length": length}
    answer = client.post("/v2/models/double/infer", content=b"{}", headers=headers)
    assert answer.status_code == 400
