"""SIMD values of sixteen float32 lanes inside kernels, on any processor.

LLVM lowers ``<16 x float>`` to the registers of the machine: one of AVX-512, two of AVX, four of
SSE or NEON. Kernels read as scalar arithmetic and need no auto-vectoriser. In an operation with
lanes, a scalar is broadcast to all lanes.
"""

import operator
from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import intrinsic, lower_builtin, models, register_model

LANES = 16
INDEX, FLOAT = ir.IntType(32), ir.FloatType()
INDICES, FLOATS = ir.VectorType(INDEX, LANES), ir.VectorType(FLOAT, LANES)
_BITS = ir.VectorType(ir.IntType(1), LANES)

# 2 to the x on [-1/2, 1/2], highest power first: minimax in relative error (9.1e-8) among those
# that are exact at 0, where most of an opaque footprint's weight is.
_EXP2 = (
    0.0013264727197302498,
    0.009671512639646995,
    0.05550733743251582,
    0.240222420853751,
    0.6931469775991637,
    1.0,
)


class LanesType(types.Type):
    """Sixteen float32 values."""

    def __init__(self) -> None:
        super().__init__(name="lanes")


class MaskType(types.Type):
    """Sixteen truth values."""

    def __init__(self) -> None:
        super().__init__(name="mask")


lanes, mask = LanesType(), MaskType()


@register_model(LanesType)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: types.Type) -> None:
        super().__init__(manager, kind, FLOATS)


@register_model(MaskType)
class _MaskModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: types.Type) -> None:
        super().__init__(manager, kind, _BITS)


def _broadcast(context: Any, builder: Any, value: Any, kind: types.Type) -> Any:
    """A scalar in all lanes; lanes unchanged."""
    if isinstance(kind, LanesType):
        return value
    scalar = context.cast(builder, value, kind, types.float32)
    first = builder.insert_element(ir.Constant(FLOATS, ir.Undefined), scalar, INDEX(0))
    return builder.shuffle_vector(first, first, ir.Constant(INDICES, [0] * LANES))


def _broadcast_all(context: Any, builder: Any, sig: Any, args: Any) -> list[Any]:
    return [_broadcast(context, builder, a, k) for a, k in zip(args, sig.args, strict=True)]


def _register_operator(symbol: Any, result: types.Type, emit: Callable[..., Any]) -> None:
    """Define ``symbol`` for lanes with lanes or scalars."""

    @infer_global(symbol)
    class _Typing(AbstractTemplate):
        def generic(self, args: Any, kws: Any) -> Any:
            known = all(isinstance(a, LanesType | types.Float) for a in args)
            if known and any(isinstance(a, LanesType) for a in args):
                return signature(result, *args)
            return None

    def lower(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return emit(builder, *_broadcast_all(context, builder, sig, args))

    lower_builtin(symbol, LanesType, LanesType)(lower)
    lower_builtin(symbol, LanesType, types.Float)(lower)
    lower_builtin(symbol, types.Float, LanesType)(lower)


_register_operator(operator.add, lanes, lambda b, x, y: b.fadd(x, y))
_register_operator(operator.sub, lanes, lambda b, x, y: b.fsub(x, y))
_register_operator(operator.mul, lanes, lambda b, x, y: b.fmul(x, y))
_register_operator(operator.truediv, lanes, lambda b, x, y: b.fdiv(x, y))
_register_operator(operator.lt, mask, lambda b, x, y: b.fcmp_ordered("<", x, y))
_register_operator(operator.le, mask, lambda b, x, y: b.fcmp_ordered("<=", x, y))
_register_operator(operator.gt, mask, lambda b, x, y: b.fcmp_ordered(">", x, y))
_register_operator(operator.ge, mask, lambda b, x, y: b.fcmp_ordered(">=", x, y))


@infer_global(operator.and_)
class _AndTyping(AbstractTemplate):
    def generic(self, args: Any, kws: Any) -> Any:
        return signature(mask, *args) if args == (mask, mask) else None


@lower_builtin(operator.and_, MaskType, MaskType)
def _and(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    return builder.and_(*args)


def _call(builder: Any, name: str, args: list[Any]) -> Any:
    kind = ir.FunctionType(FLOATS, [FLOATS] * len(args))
    return builder.call(cgutils.get_or_insert_function(builder.module, kind, name), args)


def _bits(builder: Any, where: Any) -> Any:
    return builder.bitcast(where, ir.IntType(LANES))


@intrinsic
def fill(typing_context, value):
    """A scalar in all lanes."""
    return lanes(value), lambda c, b, sig, args: _broadcast(c, b, args[0], sig.args[0])


@intrinsic
def fma(typing_context, x, y, z):
    """X y + z, rounded once."""

    def emit(context, builder, sig, args):
        return _call(builder, "llvm.fma.v16f32", _broadcast_all(context, builder, sig, args))

    return lanes(x, y, z), emit


@intrinsic
def less_product(typing_context, x, y, z):
    """X - y z, rounded once."""

    def emit(context, builder, sig, args):
        x, y, z = _broadcast_all(context, builder, sig, args)
        return _call(builder, "llvm.fma.v16f32", [builder.fneg(y), z, x])

    return lanes(x, y, z), emit


@intrinsic
def minimum(typing_context, x, y):
    """The smaller one, lane by lane."""

    def emit(context, builder, sig, args):
        x, y = _broadcast_all(context, builder, sig, args)
        return builder.select(builder.fcmp_ordered("<", x, y), x, y)

    return lanes(x, y), emit


@intrinsic
def select(typing_context, where, yes, no):
    """``yes`` under the mask, ``no`` elsewhere."""

    def emit(context, builder, sig, args):
        choices = zip(args[1:], sig.args[1:], strict=True)
        return builder.select(args[0], *(_broadcast(context, builder, a, k) for a, k in choices))

    return lanes(where, yes, no), emit


@intrinsic
def any_of(typing_context, where):
    """Whether the mask holds in any lane."""

    def emit(context, builder, sig, args):
        bits = _bits(builder, args[0])
        return builder.icmp_unsigned("!=", bits, bits.type(0))

    return types.boolean(where), emit


@intrinsic
def count(typing_context, where):
    """In how many lanes the mask holds."""

    def emit(context, builder, sig, args):
        return builder.zext(builder.ctpop(_bits(builder, args[0])), ir.IntType(64))

    return types.int64(where), emit


@intrinsic
def total(typing_context, x):
    """Sum over the lanes as a balanced tree: the same bits on every machine."""

    def emit(context, builder, sig, args):
        value = args[0]
        for width in (8, 4, 2, 1):
            kind = ir.VectorType(INDEX, width)
            low = ir.Constant(kind, list(range(width)))
            high = ir.Constant(kind, list(range(width, 2 * width)))
            value = builder.fadd(
                builder.shuffle_vector(value, value, low),
                builder.shuffle_vector(value, value, high),
            )
        return builder.extract_element(value, INDEX(0))

    return types.float32(x), emit


@intrinsic
def totals(typing_context, x0, x1, x2, x3, x4, x5, x6, x7):
    """The totals of eight values, in the first eight lanes: a tree that halves all at once."""

    def emit(context, builder, sig, args):
        values, width = list(args), LANES
        while width > LANES // 8:
            half = width // 2
            # Runs of `width` lanes belong to one total; keep the first and the second half of each.
            low = [lane for lane in range(2 * LANES) if lane % width < half]
            kinds = [ir.Constant(INDICES, [lane + shift for lane in low]) for shift in (0, half)]
            pairs = zip(values[::2], values[1::2], strict=True)
            values = [
                builder.fadd(*(builder.shuffle_vector(x, y, kind) for kind in kinds))
                for x, y in pairs
            ]
            width = half
        even = ir.Constant(INDICES, [2 * (lane % 8) for lane in range(LANES)])
        odd = ir.Constant(INDICES, [2 * (lane % 8) + 1 for lane in range(LANES)])
        last = values[0]
        return builder.fadd(
            builder.shuffle_vector(last, last, even), builder.shuffle_vector(last, last, odd)
        )

    return lanes(x0, x1, x2, x3, x4, x5, x6, x7), emit


@intrinsic
def exp2(typing_context, x):
    """2 to the x, to 2e-7 relative for x between -126 and 127; elsewhere any number.

    The whole part goes to the exponent bits, the rest in [-1/2, 1/2] into a polynomial.
    """

    def emit(context, builder, sig, args):
        whole = _call(builder, "llvm.rint.v16f32", [args[0]])
        rest = builder.fsub(args[0], whole)
        power = ir.Constant(FLOATS, [_EXP2[0]] * LANES)
        for coefficient in _EXP2[1:]:
            term = ir.Constant(FLOATS, [coefficient] * LANES)
            power = _call(builder, "llvm.fma.v16f32", [power, rest, term])
        exponent = builder.shl(builder.fptosi(whole, INDICES), ir.Constant(INDICES, [23] * LANES))
        return builder.bitcast(builder.add(builder.bitcast(power, INDICES), exponent), FLOATS)

    return lanes(x), emit
