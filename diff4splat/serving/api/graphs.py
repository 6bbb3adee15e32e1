"""Routes of the Open Inference Protocol, version 2: one model per ONNX graph.

https://github.com/kserve/open-inference-protocol, JSON tensors. Names and shapes are those of the
manifest.
"""

import asyncio
from typing import Annotated, Any, Literal

import numpy as np
from fastapi import APIRouter, HTTPException, Request
from pydantic import BaseModel, Field, ValidationError

from diff4splat.errors import Diff4SplatError
from diff4splat.models.onnx.manifest import GraphEntry, TensorSpec
from diff4splat.serving.api.photo import read_body
from diff4splat.serving.api.state import Server, ServerState

DATATYPES = {"float32": "FP32", "int64": "INT64", "bool": "BOOL"}
BYTES_PER_NUMBER = 24
"""Of JSON text, at most."""
graph_router = APIRouter(prefix="/v2/models", tags=["inference"])
UNKNOWN = {
    401: {"description": "The token is missing or wrong."},
    404: {"description": "There is no such graph."},
}
REFUSED = UNKNOWN | {
    400: {"description": "The body or a tensor cannot be used; the message names it."},
    408: {"description": "The body came too slowly."},
    413: {"description": "The tensors are too large."},
}


class RequestTensor(BaseModel):
    """An input as JSON."""

    name: str
    shape: Annotated[list[Annotated[int, Field(ge=0, le=1 << 24)]], Field(max_length=8)]
    datatype: Literal["FP32", "INT64", "BOOL"]
    data: list[Any]
    """Numbers in row-major order, flat or nested."""


class InferRequest(BaseModel):
    """All inputs of one evaluation."""

    id: str = ""
    inputs: list[RequestTensor]


class ResponseTensor(BaseModel):
    """An output as JSON."""

    name: str
    shape: list[int]
    datatype: str
    data: list[Any]
    """Numbers in row-major order, flat."""


class InferResponse(BaseModel):
    """All outputs of one evaluation."""

    id: str
    model_name: str
    outputs: list[ResponseTensor]


class TensorMetadata(BaseModel):
    """An input or output; −1 stands for any length that the manifest allows."""

    name: str
    datatype: str
    shape: list[int]


class GraphMetadata(BaseModel):
    """One graph."""

    name: str
    platform: str = "onnxruntime_onnx"
    versions: list[str] = ["1"]
    inputs: list[TensorMetadata]
    outputs: list[TensorMetadata]


INFER_SCHEMA = InferRequest.model_json_schema()
INFER_SCHEMA["properties"]["inputs"]["items"] = RequestTensor.model_json_schema()
del INFER_SCHEMA["$defs"]
BODY = {"required": True, "content": {"application/json": {"schema": INFER_SCHEMA}}}


@graph_router.get("/{name}", responses=UNKNOWN)
async def describe_graph(name: str, server: Server) -> GraphMetadata:
    """What a graph takes and gives."""
    entry = _entry(server, name)
    return GraphMetadata(
        name=entry.name,
        inputs=[_metadata(spec) for spec in entry.inputs],
        outputs=[_metadata(spec) for spec in entry.outputs],
    )


@graph_router.get("/{name}/ready", responses=UNKNOWN)
async def graph_ready(name: str, server: Server) -> dict[str, bool]:
    """Whether a graph can be asked."""
    return {"ready": bool(_entry(server, name))}


@graph_router.post("/{name}/infer", responses=REFUSED, openapi_extra={"requestBody": BODY})
async def infer(name: str, request: Request, server: Server) -> InferResponse:
    """Evaluate a graph."""
    entry = _entry(server, name)
    limit = BYTES_PER_NUMBER * server.settings.infer_elements
    body = await read_body(request, limit, server.settings.upload_s)
    try:
        return await asyncio.to_thread(_evaluate, server, entry, body)
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False, include_context=False)[0]
        where = ".".join(map(str, first["loc"])) or "body"
        raise HTTPException(400, f"{where}: {first['msg']}") from error
    except Diff4SplatError as error:
        raise HTTPException(400, str(error)) from error


def _evaluate(server: ServerState, entry: GraphEntry, body: bytes) -> InferResponse:
    asked = InferRequest.model_validate_json(body)
    limit = server.settings.infer_elements
    if sum(_count(tensor.shape) for tensor in asked.inputs) > limit:
        raise HTTPException(413, f"inputs: expected at most {limit} numbers in all")
    arrays = {tensor.name: _array(tensor) for tensor in asked.inputs}
    found = server.graphs.run(entry.name, arrays)
    outputs = [
        ResponseTensor(
            name=spec.name,
            shape=list(found[spec.name].shape),
            datatype=DATATYPES[spec.dtype],
            data=_finite(spec.name, found[spec.name]).ravel().tolist(),
        )
        for spec in entry.outputs
    ]
    return InferResponse(id=asked.id, model_name=entry.name, outputs=outputs)


def _array(tensor: RequestTensor) -> np.ndarray:
    dtype = {value: key for key, value in DATATYPES.items()}[tensor.datatype]
    try:
        with np.errstate(over="ignore"):
            array = np.asarray(tensor.data, dtype=dtype).reshape(tensor.shape)
    except (ValueError, TypeError, OverflowError) as error:
        raise HTTPException(
            400, f"inputs.{tensor.name}.data: expected {tensor.datatype} of shape {tensor.shape}"
        ) from error
    if array.dtype == np.float32 and not np.isfinite(array).all():
        raise HTTPException(400, f"inputs.{tensor.name}.data: expected finite numbers")
    return array


def _finite(name: str, array: np.ndarray) -> np.ndarray:
    """JSON has no infinity."""
    if not np.isfinite(array).all():
        raise HTTPException(400, f"outputs.{name}: not finite for these inputs")
    return array


def _count(shape: list[int]) -> int:
    total = 1
    for length in shape:
        total *= length
    return total


def _entry(server: ServerState, name: str) -> GraphEntry:
    entries = server.graphs.entries
    if name not in entries:
        listed = ", ".join(entries) or "none: the model holds no ONNX graphs"
        raise HTTPException(404, f"name: expected a graph ({listed})")
    return entries[name]


def _metadata(spec: TensorSpec) -> TensorMetadata:
    shape = [axis if isinstance(axis, int) else -1 for axis in spec.shape]
    return TensorMetadata(name=spec.name, datatype=DATATYPES[spec.dtype], shape=shape)
