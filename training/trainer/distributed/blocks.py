"""The blocks of a stage: elements of module lists inside its trained parts."""

from collections.abc import Iterator

from torch import nn

from diff4splat.training.stage import Stage


def all_blocks(stage: Stage) -> Iterator[nn.Module]:
    """List elements inside trained parts that can be called and have weights, inner ones first."""
    for part in stage.trained:
        for owner in reversed(list(stage.get_submodule(part).modules())):
            if isinstance(owner, nn.ModuleList):
                yield from filter(_is_block, owner)


def outer_blocks(stage: Stage) -> Iterator[nn.Module]:
    """Those that lie in no other."""
    blocks = list(all_blocks(stage))
    inner = {id(below) for block in blocks for below in block.modules() if below is not block}
    yield from (block for block in blocks if id(block) not in inner)


def _is_block(module: nn.Module) -> bool:
    callable_ = not isinstance(module, nn.ModuleList | nn.ModuleDict)
    return callable_ and any(True for _ in module.parameters())
