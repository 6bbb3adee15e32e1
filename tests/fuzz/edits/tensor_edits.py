"""Tensors that a torch file may hold and no reader expects, in place of one of its tensors."""

import io
from collections.abc import Callable
from random import Random

import torch
from torch import Tensor

from diff4splat.io.checkpoints.torch_file import require_loadable


def _same_size(tensor: Tensor, value: float) -> Tensor:
    return torch.full_like(tensor.float(), value)


ODD_TENSORS: tuple[Callable[[Tensor], object], ...] = (
    lambda tensor: tensor.new_zeros(()).expand(tensor.shape),
    lambda tensor: tensor.new_zeros(1).as_strided((1 << 17, 1 << 17), (0, 0)),
    lambda tensor: tensor.new_zeros(1).as_strided((1, 4, 1 << 20, 1 << 20), (0, 0, 0, 0)),
    lambda tensor: tensor.float().to_sparse(),
    lambda tensor: torch.sparse_coo_tensor(torch.zeros(1, 1).long(), torch.ones(1), (1 << 40,)),
    lambda tensor: torch.empty(tensor.shape, device="meta"),
    lambda tensor: torch.empty(1 << 40, device="meta"),
    lambda tensor: torch.quantize_per_tensor(tensor.float(), 0.1, 0, torch.qint8),
    lambda tensor: tensor.to(torch.complex64),
    lambda tensor: tensor.to(torch.float8_e4m3fn),
    lambda tensor: tensor.to(torch.bfloat16),
    lambda tensor: tensor.to(torch.int16),
    lambda tensor: tensor.bool(),
    lambda tensor: tensor.double(),
    lambda tensor: torch.nn.Parameter(tensor.float()),
    lambda tensor: _same_size(tensor, float("nan")),
    lambda tensor: _same_size(tensor, 1e38),
    lambda tensor: _same_size(tensor, -1e38),
    lambda tensor: tensor[:0],
    lambda tensor: tensor[None],
    lambda tensor: tensor.flatten(),
    lambda tensor: tensor.mT if tensor.ndim > 1 else tensor,
    lambda tensor: tensor.reshape(()) if tensor.numel() == 1 else tensor[..., :1],
    lambda tensor: tensor.flatten()[:100].tolist(),
    lambda tensor: None,
    lambda tensor: 10**5000,
    lambda tensor: {"a": tensor},
)


MOST_NUMBERS = 1_000_000


def odd_tensor(content: bytes, rng: Random) -> bytes:
    """One tensor of a torch file replaced."""
    require_loadable(content)  # after another edit it may not be
    root = torch.load(io.BytesIO(content), weights_only=True)
    changed = io.BytesIO()
    count = _count(root)
    torch.save(_replaced(root, [rng.randrange(max(count, 1))], rng.choice(ODD_TENSORS)), changed)
    return changed.getvalue()


def _count(value: object) -> int:
    if isinstance(value, Tensor):
        return 1
    if isinstance(value, dict):
        return sum(map(_count, value.values()))
    return sum(map(_count, value)) if isinstance(value, list | tuple) else 0


def _replaced(value: object, left: list[int], odd: Callable[[Tensor], object]) -> object:
    """The same value; the tensor at which ``left[0]`` has counted down to 0 is replaced."""
    if isinstance(value, Tensor):
        left[0] -= 1
        # After another edit a tensor may stand for more numbers than memory holds.
        small = value.numel() < MOST_NUMBERS
        return odd(value.detach()) if left[0] == -1 and small else value
    if isinstance(value, dict):
        return {key: _replaced(inner, left, odd) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return type(value)(_replaced(inner, left, odd) for inner in value)
    return value
