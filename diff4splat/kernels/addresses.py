"""What kernels here do with lanes and memory beyond the rasteriser's operations.

Arrays that are handed from function to function are counted, which costs more than what is done per
hit. Where that matters an `address` is handed on, and whoever holds the array keeps it alive.
"""

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from diff4splat.kernels.jit import inlined
from diff4splat.kernels.simd16 import FLOATS, LANES, lanes

_WORD = ir.IntType(64)


@intrinsic
def bits(typing_context, where):
    """A mask as an integer, the first lane lowest."""

    def emit(context, builder, sig, args):
        return builder.zext(builder.bitcast(args[0], ir.IntType(LANES)), _WORD)

    return types.int64(where), emit


def _counted_zeros(builder: Any, word: Any, name: str) -> Any:
    kind = ir.FunctionType(_WORD, [_WORD, ir.IntType(1)])
    function = cgutils.get_or_insert_function(builder.module, kind, name)
    return builder.call(function, [word, ir.IntType(1)(1)])


@intrinsic
def first_bit(typing_context, word):
    """Place of the lowest 1 of an integer that is not 0."""

    def emit(context, builder, sig, args):
        return _counted_zeros(builder, args[0], "llvm.cttz.i64")

    return types.int64(types.int64), emit


@intrinsic
def last_bit(typing_context, word):
    """Place of the highest 1 of an integer that is not 0."""

    def emit(context, builder, sig, args):
        return builder.sub(_WORD(63), _counted_zeros(builder, args[0], "llvm.ctlz.i64"))

    return types.int64(types.int64), emit


@intrinsic
def root(typing_context, x):
    """Square roots."""

    def emit(context, builder, sig, args):
        kind = ir.FunctionType(FLOATS, [FLOATS])
        function = cgutils.get_or_insert_function(builder.module, kind, "llvm.sqrt.v16f32")
        return builder.call(function, args)

    return lanes(x), emit


@inlined
def address(array):
    """Where a C-contiguous array begins."""
    return array.ctypes.data


def _place(builder: Any, address: Any, index: Any, kind: Any) -> Any:
    return builder.gep(builder.inttoptr(address, kind.as_pointer()), [index])


def _reader(kind: types.Type, llvm_kind: Any, doc: str) -> Any:
    def at(typing_context, address, index):
        def emit(context, builder, sig, args):
            return builder.load(_place(builder, *args, llvm_kind))

        return kind(types.int64, types.int64), emit

    at.__doc__ = doc
    return intrinsic(at)


def _writer(kind: types.Type, llvm_kind: Any, doc: str) -> Any:
    def put(typing_context, address, index, value):
        def emit(context, builder, sig, args):
            builder.store(args[2], _place(builder, *args[:2], llvm_kind))
            return context.get_dummy_value()

        return types.void(types.int64, types.int64, kind), emit

    put.__doc__ = doc
    return intrinsic(put)


_FLOAT, _DOUBLE, _INT = ir.FloatType(), ir.DoubleType(), ir.IntType(32)
float_at = _reader(types.float32, _FLOAT, "A float32 by its place from an address on.")
double_at = _reader(types.float64, _DOUBLE, "A float64 by its place from an address on.")
int_at = _reader(types.int32, _INT, "An int32 by its place from an address on.")
word_at = _reader(types.int64, _WORD, "An int64 by its place from an address on.")
put_float = _writer(types.float32, _FLOAT, "Write a float32 to a place from an address on.")
put_double = _writer(types.float64, _DOUBLE, "Write a float64 to a place from an address on.")
put_int = _writer(types.int32, _INT, "Write an int32 to a place from an address on.")
put_word = _writer(types.int64, _WORD, "Write an int64 to a place from an address on.")


@intrinsic
def lanes_at(typing_context, address, index):
    """Sixteen neighbouring float32 from a place on."""

    def emit(context, builder, sig, args):
        place = _place(builder, *args, _FLOAT)
        return builder.load(builder.bitcast(place, FLOATS.as_pointer()), align=4)

    return lanes(types.int64, types.int64), emit


@intrinsic
def put_lanes(typing_context, address, index, x):
    """Write sixteen neighbouring float32 from a place on."""

    def emit(context, builder, sig, args):
        place = _place(builder, *args[:2], _FLOAT)
        builder.store(args[2], builder.bitcast(place, FLOATS.as_pointer()), align=4)
        return context.get_dummy_value()

    return types.void(types.int64, types.int64, lanes), emit


@intrinsic
def prefetch_at(typing_context, address):
    """Ask for the two cache lines at an address, which will be read soon."""

    def emit(context, builder, sig, args):
        byte, number = ir.IntType(8), ir.IntType(32)
        kind = ir.FunctionType(ir.VoidType(), [byte.as_pointer(), number, number, number])
        function = cgutils.get_or_insert_function(builder.module, kind, "llvm.prefetch.p0")
        read, keep, data = number(0), number(3), number(1)
        place = builder.inttoptr(args[0], byte.as_pointer())
        for line in (place, builder.gep(place, [_WORD(64)])):
            builder.call(function, [line, read, keep, data])
        return context.get_dummy_value()

    return types.void(types.int64), emit
