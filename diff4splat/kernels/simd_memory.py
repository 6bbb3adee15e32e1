"""Loads and stores of lanes, and prefetches of cache lines.

A block is 8 columns by 2 rows of pixels: lane 8 r + c is row r, column c.
"""

from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from diff4splat.kernels.jit import contracted
from diff4splat.kernels.simd16 import FLOAT, FLOATS, INDEX, INDICES, LANES, lanes

BLOCK_COLUMNS, BLOCK_ROWS = 8, 2
_CACHE_LINE = 64
_ROW = ir.VectorType(FLOAT, BLOCK_COLUMNS)
_ROW_INDEX = ir.VectorType(INDEX, BLOCK_COLUMNS)


def _address(context: Any, builder: Any, kind: types.Type, array: Any, offset: Any) -> Any:
    data = context.make_array(kind)(context, builder, array).data
    return builder.gep(data, [offset])


@intrinsic
def load(typing_context, array, offset):
    """Sixteen neighbours of a flat float32 array."""

    def emit(context, builder, sig, args):
        address = _address(context, builder, sig.args[0], *args)
        return builder.load(builder.bitcast(address, FLOATS.as_pointer()), align=4)

    return lanes(array, types.int64), emit


@intrinsic
def store(typing_context, array, offset, x):
    """Write sixteen neighbours of a flat float32 array."""

    def emit(context, builder, sig, args):
        address = _address(context, builder, sig.args[0], *args[:2])
        builder.store(args[2], builder.bitcast(address, FLOATS.as_pointer()), align=4)
        return context.get_dummy_value()

    return types.void(array, types.int64, lanes), emit


@intrinsic
def store_eight(typing_context, array, offset, x):
    """Write the first eight lanes to neighbours of a C-contiguous float32 array."""

    def emit(context, builder, sig, args):
        address = _address(context, builder, sig.args[0], *args[:2])
        values = builder.shuffle_vector(args[2], args[2], ir.Constant(_ROW_INDEX, list(range(8))))
        builder.store(values, builder.bitcast(address, _ROW.as_pointer()), align=4)
        return context.get_dummy_value()

    return types.void(array, types.int64, lanes), emit


@intrinsic
def load_block(typing_context, image, offset, pitch):
    """A block of a flat float32 image whose rows are ``pitch`` apart."""

    def emit(context, builder, sig, args):
        top = _address(context, builder, sig.args[0], *args[:2])
        rows = [
            builder.load(builder.bitcast(row, _ROW.as_pointer()), align=4)
            for row in (top, builder.gep(top, [args[2]]))
        ]
        return builder.shuffle_vector(*rows, ir.Constant(INDICES, list(range(LANES))))

    return lanes(image, types.int64, types.int64), emit


@intrinsic
def store_block(typing_context, image, offset, pitch, x):
    """Write a block of a flat float32 image whose rows are ``pitch`` apart."""

    def emit(context, builder, sig, args):
        top = _address(context, builder, sig.args[0], *args[:2])
        for start, row in ((0, top), (BLOCK_COLUMNS, builder.gep(top, [args[2]]))):
            which = ir.Constant(_ROW_INDEX, list(range(start, start + BLOCK_COLUMNS)))
            values = builder.shuffle_vector(args[3], args[3], which)
            builder.store(values, builder.bitcast(row, _ROW.as_pointer()), align=4)
        return context.get_dummy_value()

    return types.void(image, types.int64, types.int64, lanes), emit


@intrinsic
def block_columns(typing_context):
    """Column of every lane."""
    value = ir.Constant(FLOATS, [float(lane % BLOCK_COLUMNS) for lane in range(LANES)])
    return lanes(), lambda context, builder, sig, args: value


@intrinsic
def block_rows(typing_context):
    """Row of every lane."""
    value = ir.Constant(FLOATS, [float(lane // BLOCK_COLUMNS) for lane in range(LANES)])
    return lanes(), lambda context, builder, sig, args: value


@intrinsic
def prefetch(typing_context, array, row):
    """Ask for the start of a row of a C-contiguous 2D array that will be read soon."""

    def emit(context, builder, sig, args):
        struct = context.make_array(sig.args[0])(context, builder, args[0])
        offset = builder.mul(args[1], builder.extract_value(struct.shape, 1))
        address = builder.bitcast(builder.gep(struct.data, [offset]), ir.IntType(8).as_pointer())
        kind = ir.FunctionType(ir.VoidType(), [address.type, INDEX, INDEX, INDEX])
        function = cgutils.get_or_insert_function(builder.module, kind, "llvm.prefetch.p0")
        read, keep, data = INDEX(0), INDEX(3), INDEX(1)
        builder.call(function, [address, read, keep, data])
        return context.get_dummy_value()

    return types.void(array, types.int64), emit


@contracted
def aligned_floats(size):
    """A flat float32 array on a cache line: lanes that straddle two lines cost twice."""
    room = np.empty(size + _CACHE_LINE // 4, np.float32)
    skip = (-room.ctypes.data % _CACHE_LINE) // 4
    return room[skip : skip + size]
