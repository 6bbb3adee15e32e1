"""Routes of the Open Inference Protocol, version 2: one model per ONNX graph.

https://github.com/kserve/open-inference-protocol. Names and shapes are those of the manifest.
"""

import asyncio

import numpy as np
from fastapi import APIRouter, HTTPException, Request, Response
from pydantic import BaseModel, ValidationError

from diff4splat.errors import Diff4SplatError
from diff4splat.models.onnx.manifest import GraphEntry, TensorSpec
from diff4splat.serving.api.photo import read_body
from diff4splat.serving.api.state import Server, ServerState
from diff4splat.serving.api.tensors import (
    DATATYPES,
    HEADER_LENGTH,
    InferRequest,
    InferResponse,
    infer_schema,
    read_arrays,
    split_body,
    write_output,
)

BYTES_PER_NUMBER = 24
"""Of JSON text, at most."""
EXTENSIONS = ("binary_tensor_data",)
graph_router = APIRouter(prefix="/v2/models", tags=["inference"])
UNKNOWN = {
    401: {"description": "The token is missing or wrong."},
    404: {"description": "There is no such graph."},
}
REFUSED = UNKNOWN | {
    200: {"description": "Outputs as JSON, or with bytes behind it.", "model": InferResponse},
    400: {"description": "The body or a tensor cannot be used; the message names it."},
    408: {"description": "The body came too slowly."},
    413: {"description": "The tensors are too large."},
}
BODY = {"required": True, "content": {"application/json": {"schema": infer_schema()}}}


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
async def infer(name: str, request: Request, server: Server) -> Response:
    """Evaluate a graph."""
    entry = _entry(server, name)
    limit = BYTES_PER_NUMBER * server.settings.infer_elements
    body = await read_body(request, limit, server.settings.upload_s)
    header_length = request.headers.get(HEADER_LENGTH)
    try:
        return await asyncio.to_thread(_evaluate, server, entry, body, header_length)
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False, include_context=False)[0]
        where = ".".join(map(str, first["loc"])) or "body"
        raise HTTPException(400, f"{where}: {first['msg']}") from error
    except Diff4SplatError as error:
        raise HTTPException(400, str(error)) from error


def _evaluate(
    server: ServerState, entry: GraphEntry, body: bytes, header_length: str | None
) -> Response:
    text, binary = split_body(body, header_length)
    asked = InferRequest.model_validate_json(text)
    arrays = read_arrays(asked, binary, server.settings.infer_elements)
    return _response(asked, entry, server.graphs.run(entry.name, arrays))


def _response(asked: InferRequest, entry: GraphEntry, found: dict[str, np.ndarray]) -> Response:
    as_bytes = asked.parameters.binary_data_output
    outputs = [
        write_output(spec.name, spec.dtype, found[spec.name], as_bytes) for spec in entry.outputs
    ]
    answer = InferResponse(id=asked.id, model_name=entry.name, outputs=outputs)
    text = answer.model_dump_json(exclude_none=True).encode()
    if not as_bytes:
        return Response(text, media_type="application/json")
    content = b"".join([text, *(found[spec.name].tobytes() for spec in entry.outputs)])
    headers = {HEADER_LENGTH: str(len(text))}
    return Response(content, media_type="application/octet-stream", headers=headers)


def _entry(server: ServerState, name: str) -> GraphEntry:
    entries = server.graphs.entries
    if name not in entries:
        listed = ", ".join(entries) or "none: the model holds no ONNX graphs"
        raise HTTPException(404, f"name: expected a graph ({listed})")
    return entries[name]


def _metadata(spec: TensorSpec) -> TensorMetadata:
    shape = [axis if isinstance(axis, int) else -1 for axis in spec.shape]
    return TensorMetadata(name=spec.name, datatype=DATATYPES[spec.dtype], shape=shape)
