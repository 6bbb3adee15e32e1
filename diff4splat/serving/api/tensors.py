"""Tensors of the Open Inference Protocol: JSON, and bytes behind it (binary tensor data extension).

<JSON of N bytes><bytes of each input with binary_data_size, little-endian, row-major>
header  Inference-Header-Content-Length: N
"""

from typing import Annotated, Any, Literal

import numpy as np
from fastapi import HTTPException
from pydantic import BaseModel, Field

DATATYPES = {"float32": "FP32", "int64": "INT64", "bool": "BOOL"}
DTYPES = {"FP32": np.dtype("<f4"), "INT64": np.dtype("<i8"), "BOOL": np.dtype(np.bool_)}
HEADER_LENGTH = "inference-header-content-length"


class TensorParameters(BaseModel):
    """Where the numbers of an input are."""

    binary_data_size: Annotated[int, Field(ge=0, le=1 << 31)] | None = None


class RequestTensor(BaseModel):
    """An input."""

    name: str
    shape: Annotated[list[Annotated[int, Field(ge=0, le=1 << 24)]], Field(max_length=8)]
    datatype: Literal["FP32", "INT64", "BOOL"]
    data: list[Any] | None = None
    """Numbers in row-major order, flat or nested; none if they follow as bytes."""
    parameters: TensorParameters = TensorParameters()


class RequestParameters(BaseModel):
    """How the outputs are to come."""

    binary_data_output: bool = False


class InferRequest(BaseModel):
    """All inputs of one evaluation."""

    id: Annotated[str, Field(max_length=200)] = ""
    inputs: list[RequestTensor]
    parameters: RequestParameters = RequestParameters()


class ResponseTensor(BaseModel):
    """An output."""

    name: str
    shape: list[int]
    datatype: str
    data: list[Any] | None = None
    """Numbers in row-major order, flat; none if they follow as bytes."""
    parameters: TensorParameters | None = None


class InferResponse(BaseModel):
    """All outputs of one evaluation."""

    id: str
    model_name: str
    outputs: list[ResponseTensor]


def infer_schema() -> dict[str, Any]:
    """The JSON schema of a request with everything it refers to in place."""
    schema = InferRequest.model_json_schema()
    parts = schema.pop("$defs")
    schema["properties"]["parameters"] = parts["RequestParameters"]
    tensor = parts["RequestTensor"]
    tensor["properties"]["parameters"] = parts["TensorParameters"]
    schema["properties"]["inputs"]["items"] = tensor
    return schema


def split_body(body: bytes, header_length: str | None) -> tuple[bytes, bytes]:
    """The JSON, and the bytes behind it.

    Raises:
        HTTPException: 400 if the header does not fit the body.
    """
    if header_length is None:
        return body, b""
    length = int(header_length) if header_length.isdecimal() else len(body) + 1
    if length > len(body):
        raise HTTPException(
            400, f"{HEADER_LENGTH}: expected at most {len(body)}, got {header_length}"
        )
    return body[:length], body[length:]


def read_arrays(asked: InferRequest, binary: bytes, limit: int) -> dict[str, np.ndarray]:
    """Every input as an array.

    Raises:
        HTTPException: 413 for more than ``limit`` numbers, 400 for others than the shape says.
    """
    if sum(_count(tensor.shape) for tensor in asked.inputs) > limit:
        raise HTTPException(413, f"inputs: expected at most {limit} numbers in all")
    arrays, start = {}, 0
    for tensor in asked.inputs:
        size = tensor.parameters.binary_data_size
        if size is None:
            arrays[tensor.name] = _from_json(tensor)
        else:
            arrays[tensor.name] = _from_bytes(tensor, binary[start : start + size])
            start += size
    if start != len(binary):
        raise HTTPException(400, f"body: expected {start} bytes of tensors, got {len(binary)}")
    return arrays


def write_output(name: str, dtype: str, array: np.ndarray, as_bytes: bool) -> ResponseTensor:
    """An output; its bytes, if it is to come as such, are the array's own.

    Raises:
        HTTPException: 400 if JSON cannot hold its numbers.
    """
    shape, datatype = list(array.shape), DATATYPES[dtype]
    if as_bytes:
        size = TensorParameters(binary_data_size=array.nbytes)
        return ResponseTensor(name=name, shape=shape, datatype=datatype, parameters=size)
    if not np.isfinite(array).all():
        raise HTTPException(400, f"outputs.{name}: not finite for these inputs")
    return ResponseTensor(name=name, shape=shape, datatype=datatype, data=array.ravel().tolist())


def _from_json(tensor: RequestTensor) -> np.ndarray:
    try:
        with np.errstate(over="ignore"):
            array = np.asarray(tensor.data, dtype=DTYPES[tensor.datatype]).reshape(tensor.shape)
    except (ValueError, TypeError, OverflowError) as error:
        raise _refused(tensor) from error
    return _finite(tensor, array)


def _from_bytes(tensor: RequestTensor, content: bytes) -> np.ndarray:
    dtype = DTYPES[tensor.datatype]
    if len(content) != dtype.itemsize * _count(tensor.shape):
        raise _refused(tensor)
    if dtype == np.bool_:
        return _finite(tensor, np.frombuffer(content, np.uint8).reshape(tensor.shape) != 0)
    return _finite(tensor, np.frombuffer(content, dtype).reshape(tensor.shape))


def _finite(tensor: RequestTensor, array: np.ndarray) -> np.ndarray:
    if not np.isfinite(array).all():
        raise HTTPException(400, f"inputs.{tensor.name}.data: expected finite numbers")
    return array


def _refused(tensor: RequestTensor) -> HTTPException:
    return HTTPException(
        400, f"inputs.{tensor.name}.data: expected {tensor.datatype} of shape {tensor.shape}"
    )


def _count(shape: list[int]) -> int:
    total = 1
    for length in shape:
        total *= length
    return total
