"""Tokens of one sample shared out over processes (Ulysses sequence parallelism, arXiv 2309.14509).

Axes: ``b`` batch, ``n`` all tokens, ``s`` tokens of this process, ``h`` heads, ``g`` heads of this
process, ``c`` head channels. Norms, projections and perceptrons work on each token alone. For an
attention the processes exchange tokens for heads, so that each holds all tokens of some heads, and
back after it. Their order does not matter there: positions are in the rotary angles already.

Gradients: every process computes the same loss from the joined tokens. ``join`` adds up the equal
gradients of all processes on the way back, so the mean of weight gradients over processes, which
DDP and FSDP2 take, is the gradient of one process that does everything.
"""

from dataclasses import dataclass, replace

from jaxtyping import Float
from torch import Tensor
from torch.distributed import ProcessGroup
from torch.distributed._functional_collectives import (
    all_gather_tensor_autograd,
    all_to_all_single_autograd,
)

from diff4splat.errors import ShapeError
from diff4splat.models.blocks.rope import RopeTables


@dataclass(frozen=True, slots=True, kw_only=True)
class TokenGroup:
    """The processes that share the tokens of a sample."""

    group: ProcessGroup

    @property
    def count(self) -> int:
        """Processes."""
        return self.group.size()

    def split(self, tokens: Tensor, axis: int) -> Tensor:
        """The share of this process along an axis.

        Raises:
            ShapeError: the processes do not divide it.
        """
        self._require(tokens.shape[axis], "tokens")
        return tokens.chunk(self.count, axis)[self.group.rank()]

    def join(self, tokens: Tensor, axis: int) -> Tensor:
        """All tokens at every process."""
        return all_gather_tensor_autograd(tokens.contiguous(), axis, self.group)

    def split_rope(self, tables: RopeTables, frames: int) -> RopeTables:
        """Angles of the tokens that ``split`` takes from every frame."""
        return replace(
            tables,
            cos=self.split(tables.cos.unflatten(0, (frames, -1)), 1).flatten(0, 1),
            sin=self.split(tables.sin.unflatten(0, (frames, -1)), 1).flatten(0, 1),
        )

    def to_heads(self, tokens: Float[Tensor, "k b s h c"]) -> Float[Tensor, "k b n g c"]:
        """All tokens of this process's heads, for queries, keys and values at once.

        Raises:
            ShapeError: the processes do not divide the heads.
        """
        self._require(tokens.shape[3], "heads")
        parts = tokens.unflatten(3, (self.count, -1)).movedim(3, 0)
        return self._exchange(parts).movedim(0, 2).flatten(2, 3)

    def to_tokens(self, heads: Float[Tensor, "b n g c"]) -> Float[Tensor, "b s h c"]:
        """All heads of this process's tokens."""
        parts = heads.unflatten(1, (self.count, -1)).movedim(1, 0)
        return self._exchange(parts).movedim(0, 2).flatten(2, 3)

    def _exchange(self, parts: Float[Tensor, "count ..."]) -> Float[Tensor, "count ..."]:
        """Part i goes to process i; what comes back is in the order of the senders."""
        even = [1] * self.count
        return all_to_all_single_autograd(parts.contiguous(), even, even, self.group)

    def _require(self, present: int, what: str) -> None:
        if present % self.count:
            raise ShapeError(
                f"trainer.context_parallel: expected a number that divides {present} {what}, got "
                f"{self.count}; choose a smaller one"
            )
