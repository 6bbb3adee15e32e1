"""Rows come and go, and the moments of Adam go with them."""

import torch

from diff4splat.fitting.parameter_table import ParameterTable


def table(count: int = 4) -> ParameterTable:
    columns = {"a": torch.arange(count, dtype=torch.float32), "b": torch.ones(count, 2)}
    return ParameterTable(columns, {"shared": torch.zeros(3)})


def stepped(made: ParameterTable, pull: torch.Tensor) -> ParameterTable:
    ((made["a"] * pull).sum() + made["b"].sum() + made["shared"].sum()).backward()
    made.step({"a": 0.1, "b": 0.1, "shared": 0.1})
    return made


def moments(made: ParameterTable, name: str) -> torch.Tensor:
    return made.optimizer.state[made[name]]["exp_avg"]


def test_a_step_moves_against_the_gradient_by_the_rate():
    made = stepped(table(), torch.tensor([1.0, -1.0, 1.0, 1.0]))
    expected = torch.tensor([-0.1, 1.1, 1.9, 2.9])
    torch.testing.assert_close(made["a"].detach(), expected)
    assert made["a"].grad is None


def test_what_has_no_rate_stays():
    made = table()
    made["a"].sum().backward()
    made.step({})
    assert torch.equal(made["a"].detach(), torch.arange(4.0))


def test_kept_rows_keep_their_moments():
    made = stepped(table(), torch.tensor([1.0, 2.0, 3.0, 4.0]))
    made.keep(torch.tensor([False, True, False, True]))
    assert len(made) == 2
    torch.testing.assert_close(moments(made, "a"), torch.tensor([0.2, 0.4]))
    stepped(made, torch.ones(2))
    assert len(made.optimizer.state) == 3


def test_new_rows_start_without_moments():
    made = stepped(table(), torch.ones(4))
    made.append({"a": torch.tensor([9.0]), "b": torch.zeros(1, 2)})
    torch.testing.assert_close(moments(made, "a"), torch.tensor([0.1] * 4 + [0.0]))
    assert made["a"].detach()[-1] == 9 and made["b"].shape == (5, 2)
    stepped(made, torch.ones(5))


def test_rewritten_rows_lose_theirs_and_other_columns_stay():
    made = stepped(table(), torch.ones(4))
    before = made["b"].detach().clone()
    made.rewrite(torch.tensor([1]), {"a": torch.tensor([7.0])})
    assert made["a"].detach()[1] == 7
    torch.testing.assert_close(moments(made, "a"), torch.tensor([0.1, 0.0, 0.1, 0.1]))
    assert torch.equal(made["b"].detach(), before)


def test_loading_what_was_saved_gives_the_same_next_step():
    first = stepped(table(), torch.tensor([1.0, -2.0, 3.0, 0.5]))
    kept = {name: value.clone() for name, value in first.tensors().items()}
    second = table(2)
    second.load(kept)
    for made in (first, second):
        stepped(made, torch.tensor([-1.0, 1.0, 0.3, 2.0]))
    for name in first.names:
        assert torch.equal(first[name].detach(), second[name].detach())


def test_an_empty_table_can_step():
    made = table(0)
    (made["a"].sum() + made["shared"].sum()).backward()
    made.step({"a": 0.1, "shared": 0.1})
    assert len(made) == 0
