"""Optimised parameters, per Gaussian or shared, with the state of Adam.

Axes: ``n`` Gaussians. A fit adds and removes rows. Each row keeps its Adam moments; new and
rewritten rows start with zero moments.
"""

from collections.abc import Mapping

import torch
from jaxtyping import Bool, Int
from torch import Tensor

MOMENTS = ("exp_avg", "exp_avg_sq")


class ParameterTable:
    """Leaf tensors by name, each with a separate learning rate."""

    def __init__(
        self,
        columns: Mapping[str, Tensor],
        shared: Mapping[str, Tensor],
        dtype: torch.dtype = torch.float32,
    ) -> None:
        """``columns`` have one row per Gaussian; ``shared`` tensors have any shape."""
        self.dtype = dtype
        self._columns = tuple(columns)
        self._leaves: dict[str, Tensor] = {}
        for name, value in {**columns, **shared}.items():
            self._leaves[name] = value.detach().to(dtype, copy=True).requires_grad_()
        groups = [{"params": [leaf], "name": name} for name, leaf in self._leaves.items()]
        # The published value; the default of 1e-8 would damp the small gradients of means.
        self.optimizer = torch.optim.Adam(groups, lr=0.0, eps=1e-15, fused=True)

    def __len__(self) -> int:
        return len(self._leaves[self._columns[0]])

    def __getitem__(self, name: str) -> Tensor:
        return self._leaves[name]

    def __contains__(self, name: str) -> bool:
        return name in self._leaves

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the tensors with one row per Gaussian."""
        return self._columns

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all tensors."""
        return tuple(self._leaves)

    def step(self, rates: Mapping[str, float]) -> None:
        """One step of Adam; tensors without a rate stay unchanged."""
        for group in self.optimizer.param_groups:
            group["lr"] = rates.get(group["name"], 0.0)
        self.optimizer.step()
        self.optimizer.zero_grad(set_to_none=True)

    def keep(self, mask: Bool[Tensor, " n"]) -> None:
        """Remove the rows outside ``mask``."""
        self._replace({name: self._leaves[name].detach()[mask] for name in self._columns})
        self._map_moments(lambda moment: moment[mask])

    def append(self, rows: Mapping[str, Tensor]) -> None:
        """Add rows; ``rows`` has every column."""
        joined = {
            name: torch.cat([self._leaves[name].detach(), rows[name]]) for name in self._columns
        }
        count = len(rows[self._columns[0]])
        self._replace(joined)
        self._map_moments(lambda old: torch.cat([old, old.new_zeros(count, *old.shape[1:])]))

    def rewrite(self, index: Int[Tensor, " m"], rows: Mapping[str, Tensor]) -> None:
        """Overwrite some rows and reset their moments; columns that ``rows`` lacks stay."""
        with torch.no_grad():
            for name, value in rows.items():
                self._leaves[name][index] = value
                state = self.optimizer.state.get(self._leaves[name], {})
                for moment in MOMENTS:
                    if moment in state:
                        state[moment][index] = 0

    def rewrite_shared(self, name: str, value: Tensor) -> None:
        """Overwrite a shared tensor and reset its moments."""
        with torch.no_grad():
            self._leaves[name].copy_(value)
        self.optimizer.state.pop(self._leaves[name], None)

    def tensors(self) -> dict[str, Tensor]:
        """Values and Adam state, detached: everything that the next step depends on."""
        state_dict = {}
        for name, leaf in self._leaves.items():
            state_dict[name] = leaf.detach()
            state = self.optimizer.state.get(leaf, {})
            for key, value in state.items():
                state_dict[f"{name}/{key}"] = value.detach()
        return state_dict

    def load(self, tensors: Mapping[str, Tensor]) -> None:
        """Restore the output of ``tensors``."""
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
        """Replace leaves under the same names and hand over their Adam state."""
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
