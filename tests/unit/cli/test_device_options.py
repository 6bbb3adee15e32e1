"""``--device``: names that are there, and what auto means, without any GPU."""

import pytest
import torch

from diff4splat.cli.options.device import render_device, require_device
from diff4splat.errors import ConfigError


@pytest.mark.parametrize(("available", "expected"), [(True, "cuda"), (False, "cpu")])
def test_auto_is_cuda_where_there_is_one(
    available: bool, expected: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(torch.cuda, "is_available", lambda: available)
    assert require_device("auto") == render_device("auto") == expected


def test_frames_are_rendered_on_the_cpu_without_cuda(monkeypatch: pytest.MonkeyPatch) -> None:
    """Other accelerators run networks alone; a fake allocation stands for one."""
    monkeypatch.setattr(torch, "zeros", lambda *_, **__: None)
    assert require_device("mps") == "mps" and render_device("mps") == "cpu"
    assert render_device("cuda:1") == "cuda:1"


@pytest.mark.parametrize("name", ["cuda:99", "meta", "gpu", ""])
def test_other_names_are_refused(name: str) -> None:
    with pytest.raises(ConfigError, match="--device: expected"):
        render_device(name)
