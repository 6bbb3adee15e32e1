"""The processes of a run and how they agree.

Alone, or started by ``torchrun``, which sets RANK, WORLD_SIZE and LOCAL_RANK. Tensors travel by
NCCL between GPUs; small values travel by Gloo as Python objects, so that all processes decide from
the same list in the same order. Nothing is received from outside the run.
"""

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from datetime import timedelta
from typing import TypeVar

import torch
import torch.distributed as dist
from torch.distributed.device_mesh import init_device_mesh

from diff4splat.errors import ConfigError
from diff4splat.models.placement.shared_tokens import TokenGroup
from diff4splat.training.recipe.trainer import Parallel

T = TypeVar("T")


@dataclass(frozen=True, slots=True, kw_only=True)
class Processes:
    """This process among its peers."""

    rank: int
    count: int
    device: torch.device
    sharing: TokenGroup | None = None
    """Those that compute the same samples; None where each computes its own."""

    @property
    def per_sample(self) -> int:
        """Processes that share a sample; ranks of a group follow each other."""
        return 1 if self.sharing is None else self.sharing.count

    @property
    def data_rank(self) -> int:
        """Which share of the samples this process computes."""
        return self.rank // self.per_sample

    @property
    def data_count(self) -> int:
        """Shares of the samples."""
        return self.count // self.per_sample

    @property
    def first(self) -> bool:
        """The one that writes and talks."""
        return self.rank == 0

    def gather(self, value: T) -> list[T]:
        """Everybody's value in the order of ranks, at everybody; all must call."""
        if self.count == 1:
            return [value]
        found: list = [None] * self.count
        dist.all_gather_object(found, value)
        return found

    def all_do(self, work: Callable[[], T]) -> list[T]:
        """Everybody's result at everybody; if one fails, all raise its error instead of waiting."""
        value, error = None, None
        try:
            value = work()
        except Exception as raised:
            error = raised
        found = self.gather((value, error))
        if error:
            raise error
        for _, other in found:
            if other:
                raise other
        return [theirs for theirs, _ in found]

    def first_does(self, work: Callable[[], T]) -> T:
        """Do it in the first process alone; all get its result, or its error."""
        return self.all_do(lambda: work() if self.first else None)[0]


@contextmanager
def open_processes(
    parallel: Parallel,
    device: str | None = None,
    timeout_s: float = 600.0,
    per_sample: int = 1,
) -> Iterator[Processes]:
    """Join the other processes, if any, and leave them in the end.

    Raises:
        ConfigError: several processes were started for a run that knows only one, or
            ``per_sample`` does not divide them.
    """
    rank, count = int(os.environ.get("RANK", "0")), int(os.environ.get("WORLD_SIZE", "1"))
    if parallel == "none" and count > 1:
        raise ConfigError(
            f"parallel: expected ddp or fsdp2 for {count} processes, got none; start one process "
            "or choose another"
        )
    if count % per_sample:
        raise ConfigError(
            f"trainer.context_parallel: expected a number that divides {count} processes, got "
            f"{per_sample}; start more processes or choose a smaller number"
        )
    target = _device(device)
    joined = parallel != "none" and not dist.is_initialized()
    if joined:
        _join(rank, count, target, timeout_s)
    try:
        sharing = _token_group(count, per_sample, target) if per_sample > 1 else None
        yield Processes(rank=rank, count=count, device=target, sharing=sharing)
    finally:
        if joined:
            dist.destroy_process_group()


def _token_group(count: int, per_sample: int, device: torch.device) -> TokenGroup:
    names = ("data", "context")
    shape = (count // per_sample, per_sample)
    mesh = init_device_mesh(device.type, shape, mesh_dim_names=names)
    return TokenGroup(group=mesh.get_group("context"))


def _device(wanted: str | None) -> torch.device:
    local = int(os.environ.get("LOCAL_RANK", "0"))
    found = _named_device(wanted or ("cuda" if torch.cuda.is_available() else "cpu"))
    if found.type == "cuda":
        found = torch.device("cuda", local if found.index is None else found.index)
        torch.cuda.set_device(found)
    return found


def _named_device(name: str) -> torch.device:
    with suppress(RuntimeError):
        found = torch.device(name)
        present = torch.cuda.device_count() if found.type == "cuda" else 1
        if found.type in ("cpu", "cuda") and (found.index or 0) < present:
            return found
    known = ["cpu", *(f"cuda:{index}" for index in range(torch.cuda.device_count()))]
    raise ConfigError(
        f"device: expected {' or '.join(known)}, got {name!r}; leave it out to take the best"
    )


def _join(rank: int, count: int, device: torch.device, timeout_s: float) -> None:
    # Objects travel by Gloo even between GPUs: NCCL would copy each of them through the device.
    backend = "cpu:gloo,cuda:nccl" if device.type == "cuda" else "gloo"
    store = dist.HashStore() if count == 1 else None  # alone, no port is needed
    dist.init_process_group(
        backend,
        rank=rank,
        world_size=count,
        store=store,
        timeout=timedelta(seconds=timeout_s),
    )
