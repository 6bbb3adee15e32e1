"""Sixteen float32 channels as one value inside kernels, on any processor.

LLVM lowers ``<16 x float>`` to what the machine has, so that nothing is left to an auto-vectoriser,
which cannot know that planes and gradients do not overlap.
"""

import operator
from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import intrinsic, lower_builtin, models, register_model

LANES = 16
_INDEX, _FLOAT = ir.IntType(32), ir.FloatType()
_FLOATS = ir.VectorType(_FLOAT, LANES)


class ChannelsType(types.Type):
    """Sixteen float32 values."""

    def __init__(self) -> None:
        super().__init__(name="channels")


channels = ChannelsType()


@register_model(ChannelsType)
class _ChannelsModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: types.Type) -> None:
        super().__init__(manager, kind, _FLOATS)


def _spread(context: Any, builder: Any, value: Any, kind: types.Type) -> Any:
    """A scalar in all lanes; lanes as they are."""
    if isinstance(kind, ChannelsType):
        return value
    scalar = context.cast(builder, value, kind, types.float32)
    first = builder.insert_element(ir.Constant(_FLOATS, ir.Undefined), scalar, _INDEX(0))
    zeros = ir.Constant(ir.VectorType(_INDEX, LANES), [0] * LANES)
    return builder.shuffle_vector(first, first, zeros)


def _teach(symbol: Any, emit: Callable[..., Any]) -> None:
    """Make ``symbol`` an operation on lanes with lanes or scalars."""

    @infer_global(symbol)
    class _Typing(AbstractTemplate):
        def generic(self, args: Any, kws: Any) -> Any:
            known = all(isinstance(a, ChannelsType | types.Float) for a in args)
            if known and any(isinstance(a, ChannelsType) for a in args):
                return signature(channels, *args)
            return None

    def lower(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        both = zip(args, sig.args, strict=True)
        made = emit(builder, *(_spread(context, builder, a, k) for a, k in both))
        # A product and a sum may become one fused operation.
        made.flags.append("contract")
        return made

    lower_builtin(symbol, ChannelsType, ChannelsType)(lower)
    lower_builtin(symbol, ChannelsType, types.Float)(lower)
    lower_builtin(symbol, types.Float, ChannelsType)(lower)


_teach(operator.add, lambda b, x, y: b.fadd(x, y))
_teach(operator.sub, lambda b, x, y: b.fsub(x, y))
_teach(operator.mul, lambda b, x, y: b.fmul(x, y))


def _place(context: Any, builder: Any, kind: types.Type, array: Any, offset: Any) -> Any:
    data = context.make_array(kind)(context, builder, array).data
    return builder.bitcast(builder.gep(data, [offset]), _FLOATS.as_pointer())


@intrinsic
def zeros(typing_context):
    """Zero in all lanes."""
    return channels(), lambda c, b, s, a: ir.Constant(_FLOATS, [0.0] * LANES)


@intrinsic
def load(typing_context, array, offset):
    """Sixteen neighbours of a flat float32 array."""

    def emit(context, builder, sig, args):
        return builder.load(_place(context, builder, sig.args[0], *args), align=4)

    return channels(array, types.int64), emit


@intrinsic
def store(typing_context, array, offset, x):
    """Write sixteen neighbours of a flat float32 array."""

    def emit(context, builder, sig, args):
        builder.store(args[2], _place(context, builder, sig.args[0], *args[:2]), align=4)
        return context.get_dummy_value()

    return types.void(array, types.int64, channels), emit


@intrinsic
def total(typing_context, x):
    """Sum over the lanes as a balanced tree: the same bits on every machine."""

    def emit(context, builder, sig, args):
        value = args[0]
        for width in (8, 4, 2, 1):
            kind = ir.VectorType(_INDEX, width)
            low = ir.Constant(kind, list(range(width)))
            high = ir.Constant(kind, list(range(width, 2 * width)))
            value = builder.fadd(
                builder.shuffle_vector(value, value, low),
                builder.shuffle_vector(value, value, high),
            )
        return builder.extract_element(value, _INDEX(0))

    return types.float32(x), emit
