"""Numbers that are learned: one row per Gaussian, or shared by all; and the state of Adam.

Axes: ``n`` Gaussians. Rows come and go while a scene is fitted. The moments of Adam go with their
rows; new and rewritten rows start with none.
"""

from collections.abc import Mapping

import torch
from jaxtyping import Bool, Int
from torch import Tensor

MOMENTS = ("exp_avg", "exp_avg_sq")


class ParameterTable:
    """Leaf tensors by name, each with a learning rate of its own."""

    def __init__(self, columns: Mapping[str, Tensor], shared: Mapping[str, Tensor]) -> None:
        """``columns`` have one row per Gaussian; ``shared`` tensors have any shape."""
        self._columns = tuple(columns)
        self._leaves: dict[str, Tensor] = {}
        for name, value in {**columns, **shared}.items():
            self._leaves[name] = value.detach().clone().requires_grad_()
        groups = [{"params": [leaf], "name": name} for name, leaf in self._leaves.items()]
        # The published value: with the usual one, small gradients of means would count for less.
        self.optimizer = torch.optim.Adam(groups, lr=0.0, eps=1e-15, fused=True)

    def __len__(self) -> int:
        return len(self._leaves[self._columns[0]])

    def __getitem__(self, name: str) -> Tensor:
        return self._leaves[name]

    def __contains__(self, name: str) -> bool:
        return name in self._leaves

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of what has one row per Gaussian."""
        return self._columns

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all tensors."""
        return tuple(self._leaves)

    def step(self, rates: Mapping[str, float]) -> None:
        """One step of Adam; what has no rate stays."""
        for group in self.optimizer.param_groups:
            group["lr"] = rates.get(group["name"], 0.0)
        self.optimizer.step()
        self.optimizer.zero_grad(set_to_none=True)

    def keep(self, kept: Bool[Tensor, " n"]) -> None:
        """Drop the rows of all other Gaussians."""
        self._replace({name: self._leaves[name].detach()[kept] for name in self._columns})
        self._map_moments(lambda moment: moment[kept])

    def append(self, rows: Mapping[str, Tensor]) -> None:
        """Add Gaussians; ``rows`` has every column."""
        joined = {
            name: torch.cat([self._leaves[name].detach(), rows[name]]) for name in self._columns
        }
        count = len(rows[self._columns[0]])
        self._replace(joined)
        self._map_moments(lambda old: torch.cat([old, old.new_zeros(count, *old.shape[1:])]))

    def rewrite(self, index: Int[Tensor, " m"], rows: Mapping[str, Tensor]) -> None:
        """Give some Gaussians other numbers; columns that ``rows`` lacks stay."""
        with torch.no_grad():
            for name, value in rows.items():
                self._leaves[name][index] = value
                state = self.optimizer.state.get(self._leaves[name], {})
                for moment in MOMENTS:
                    if moment in state:
                        state[moment][index] = 0

    def rewrite_shared(self, name: str, value: Tensor) -> None:
        """Give a shared tensor other numbers; it starts anew."""
        with torch.no_grad():
            self._leaves[name].copy_(value)
        self.optimizer.state.pop(self._leaves[name], None)

    def tensors(self) -> dict[str, Tensor]:
        """Everything that makes the next step, detached: values and moments."""
        found = {}
        for name, leaf in self._leaves.items():
            found[name] = leaf.detach()
            state = self.optimizer.state.get(leaf, {})
            for key, value in state.items():
                found[f"{name}/{key}"] = value.detach().float()
        return found

    def load(self, tensors: Mapping[str, Tensor]) -> None:
        """Take over what ``tensors()`` gave, rows and moments."""
        self._replace({name: tensors[name].clone() for name in self._leaves})
        self.optimizer.state.clear()
        for name, leaf in self._leaves.items():
            state = {
                key: tensors[f"{name}/{key}"].clone()
                for key in ("step", *MOMENTS)
                if f"{name}/{key}" in tensors
            }
            if state:
                self.optimizer.state[leaf] = state

    def _replace(self, values: Mapping[str, Tensor]) -> None:
        """Other leaves under the same names; their states go with them."""
        for group in self.optimizer.param_groups:
            name = group["name"]
            if name not in values:
                continue
            old, leaf = self._leaves[name], values[name].requires_grad_()
            self._leaves[name] = leaf
            group["params"] = [leaf]
            if old in self.optimizer.state:
                self.optimizer.state[leaf] = self.optimizer.state.pop(old)

    def _map_moments(self, change) -> None:
        for name in self._columns:
            state = self.optimizer.state.get(self._leaves[name], {})
            for moment in MOMENTS:
                if moment in state:
                    state[moment] = change(state[moment])
