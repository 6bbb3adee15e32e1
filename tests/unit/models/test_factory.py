import dataclasses
from pathlib import Path

import pytest
import torch
from torch import nn

from diff4splat.models.config.sizes import SIZES, paper_size, size_by_name, small_size
from diff4splat.models.config.sizes import test_size as tiny_size
from diff4splat.models.factory import create_networks, parameter_counts
from diff4splat.models.networks import PARTS, Networks, model_parts


def weights(part: nn.Module) -> torch.Tensor:
    return torch.cat([parameter.flatten() for parameter in part.parameters()])


def same(one: Networks, other: Networks) -> bool:
    pairs = zip(one.parts(), other.parts(), strict=True)
    return all(torch.equal(weights(a), weights(b)) for (_, a), (_, b) in pairs)


def test_weights_do_not_depend_on_the_global_random_state() -> None:
    torch.manual_seed(1)
    one = create_networks(tiny_size())
    torch.manual_seed(2)
    torch.rand(3)
    assert same(one, create_networks(tiny_size()))


def test_the_global_random_state_is_left_alone() -> None:
    torch.manual_seed(3)
    want = torch.rand(4)
    torch.manual_seed(3)
    create_networks(tiny_size())
    assert torch.equal(torch.rand(4), want)


def test_seeds_differ_and_parts_differ() -> None:
    one, other = create_networks(tiny_size(), seed=0), create_networks(tiny_size(), seed=1)
    for (_, a), (_, b) in zip(one.parts(), other.parts(), strict=True):
        assert not torch.equal(weights(a), weights(b))
    assert not torch.equal(
        weights(one.dit.blocks[0].attention), weights(one.dit.blocks[1].attention)
    )


def test_parts_draw_from_streams_of_their_own() -> None:
    networks = create_networks(tiny_size())
    first = [networks.dit.patch_embedding.weight, networks.ldrm.latent_embedding.weight]
    ratio = first[0].flatten()[:8] / first[1].flatten()[:8]
    assert ratio.std() > 0.1  # one stream would give the same numbers up to a factor


def test_leaving_out_a_part_changes_nothing_else() -> None:
    full = create_networks(tiny_size())
    without = create_networks(tiny_size(), parts=("vae", "dit", "ldrm", "deformation"))
    assert without.text_encoder is None
    assert [name for name, _ in without.parts()] == ["vae", "dit", "ldrm", "deformation"]
    assert same(dataclasses.replace(full, text_encoder=None), without)


def test_parts_that_the_model_lacks_are_not_built() -> None:
    assert model_parts(tiny_size()) == ("vae", "text_encoder", "dit", "ldrm", "deformation")
    own = set(PARTS) - {"image_encoder"}
    assert set(model_parts(small_size())) == own, "only imported models have it"
    networks = create_networks(tiny_size(), parts=("vae", "motion_unet"))
    assert [name for name, _ in networks.parts()] == ["vae"]


def test_no_parts_are_no_networks() -> None:
    assert create_networks(tiny_size(), parts=()) == Networks()


def test_fresh_networks_are_the_identity() -> None:
    networks = create_networks(tiny_size())
    assert networks.deformation.is_identity()
    maps = networks.ldrm(torch.randn(1, 4, 2, 2, 2), torch.randn(1, 6, 5, 16, 16))
    assert not maps.gaussians.any()


def test_parts_move_together() -> None:
    networks = create_networks(tiny_size()).to(torch.float64)
    assert all(p.dtype == torch.float64 for _, part in networks.parts() for p in part.parameters())


def test_meta_networks_allocate_nothing() -> None:
    networks = create_networks(paper_size(), "meta")
    assert all(p.is_meta for _, part in networks.parts() for p in part.state_dict().values())


@pytest.mark.parametrize("name", SIZES)
def test_counts_name_every_part(name: str) -> None:
    counts = parameter_counts(size_by_name(name))
    assert tuple(counts) == model_parts(size_by_name(name))
    assert min(counts.values()) > 0


def test_counts_are_those_of_real_weights() -> None:
    counts = parameter_counts(tiny_size())
    assert counts == {
        name: len(weights(part)) for name, part in create_networks(tiny_size()).parts()
    }


def test_small_model_stays_small() -> None:
    assert sum(parameter_counts(small_size()).values()) <= 42_000_000


def test_paper_model_has_the_published_order_of_magnitude() -> None:
    counts = parameter_counts(paper_size())
    block = 4 * 4096**2 * 2 + 2 * 4096 * 16384  # two attentions and a feed-forward
    assert counts["dit"] == pytest.approx(32 * block, rel=0.05)
    assert counts["ldrm"] == pytest.approx(16 * 12 * 1024**2, rel=0.2)
    assert 5e7 < counts["vae"] < 5e8
    assert 4e9 < counts["text_encoder"] < 6e9


def test_documentation_lists_the_counts() -> None:
    text = (Path(__file__).parents[3] / "docs" / "reference" / "networks.md").read_text(
        encoding="utf-8"
    )
    counts = [parameter_counts(make()) for make in SIZES.values()]
    rows = {part: [table.get(part) for table in counts] for part in PARTS}
    rows["total"] = [sum(table.values()) for table in counts]
    for part, row in rows.items():
        cells = " | ".join("–" if count is None else f"{count:,}" for count in row)
        assert f"| {part} | {cells} |" in text
