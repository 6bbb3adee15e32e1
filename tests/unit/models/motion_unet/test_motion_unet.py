"""The motion U-Net: zero when fresh, conditioned on text, frames interact, always finite."""

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles_models import randomised
from torch import Tensor

from diff4splat.errors import ConfigError, ShapeError
from diff4splat.models.blocks.attention import Attention
from diff4splat.models.config.networks import TextConfig
from diff4splat.models.motion_unet.layers import RANDOM_CELLS, ModulatedConvBlock
from diff4splat.models.motion_unet.text_tokens import text_tokens
from diff4splat.models.motion_unet.unet import MotionUNet, cell_coordinates

TEXT = TextConfig(width=8, blocks=1, heads=2, feedforward_width=16)
TEXT_WIDTH, TOKENS = TEXT.width, 5


def motion_unet(trained: bool = True) -> MotionUNet:
    torch.manual_seed(0)
    network = MotionUNet(8, 2, TEXT, frequency_width=16)
    return randomised(network) if trained else network


def inputs(
    batch: int = 2, frames: int = 2, size: tuple[int, int] = (32, 16)
) -> tuple[Tensor, Tensor, Tensor]:
    torch.manual_seed(1)
    noisy = torch.randn(batch, 3, frames, size[0] // 4, size[1] // 4)
    return torch.rand(batch, 3, *size), noisy, torch.rand(batch)


def some_text(batch: int = 2) -> Tensor:
    torch.manual_seed(2)
    return torch.randn(batch, TOKENS, TEXT_WIDTH)


def widened(*values: Tensor) -> list[Tensor]:
    """Rounding is no reason for a difference then."""
    return [value.double() for value in values]


def difference(one: Tensor, other: Tensor) -> float:
    return float((one - other).detach().abs().max())


@settings(max_examples=8, deadline=None)
@given(st.integers(1, 3), st.integers(1, 4), st.integers(1, 3), st.integers(1, 3), st.booleans())
def test_a_fresh_network_gives_zero_at_any_size(
    batch: int, frames: int, rows: int, columns: int, with_text: bool
) -> None:
    given_inputs = inputs(batch, frames, (16 * rows, 16 * columns))
    output = motion_unet(trained=False)(*given_inputs, some_text(batch) if with_text else None)
    assert output.shape == (batch, 3, frames, 4 * rows, 4 * columns)
    assert output.dtype == torch.float32 and not output.any()


def test_conditions_and_text_change_nothing_at_first() -> None:
    network = motion_unet(trained=False)
    torch.nn.init.normal_(network.motion_head.weight)
    image, noisy, level = inputs()
    plain = network(image, noisy, level)
    assert difference(plain, network(image, noisy, 1 - level, some_text())) == 0


def test_a_block_is_scaled_and_shifted_between_its_convolutions() -> None:
    block = randomised(ModulatedConvBlock(4, 3)).double()
    features, condition = torch.randn(2, 4, 3, 3).double(), torch.randn(2, 3).double()

    def silu(x: Tensor) -> Tensor:
        return x / (1 + (-x).exp())

    def normed(x: Tensor, gain: Tensor) -> Tensor:
        return x / (x.square().mean(1, keepdim=True) + 1e-6).sqrt() * gain[:, None, None]

    project = block.modulation.project
    steering = silu(condition) @ project.weight.T + project.bias
    scale, shift = steering[:, :4, None, None], steering[:, 4:, None, None]
    hidden = block.conv_1(silu(normed(features, block.norm_1.gain)))
    steered = normed(hidden, block.norm_2.gain) * (1 + scale) + shift
    expected = features + block.conv_2(silu(steered))
    torch.testing.assert_close(block(features, condition), expected)


def test_every_parameter_has_a_gradient() -> None:
    network = motion_unet()
    mask = torch.tensor([[True] * TOKENS, [False] * TOKENS])
    motion, mask_logits = network.predict_motion_and_mask(*inputs(), some_text(), mask)
    (motion.square().sum() + mask_logits.square().sum()).backward()
    still = [
        name
        for name, value in network.named_parameters()
        if value.grad is None or not value.grad.any()
    ]
    # A shift of all keys by one vector would cancel in the softmax, but for the norm after it.
    assert still == []


def test_the_motion_is_the_same_with_and_without_the_mask() -> None:
    network = motion_unet()
    motion, mask_logits = network.predict_motion_and_mask(*inputs(), some_text())
    assert torch.equal(motion, network(*inputs(), some_text()))
    assert mask_logits.shape == inputs()[0][:, 0].shape


def test_every_input_matters() -> None:
    network, (image, noisy, level) = motion_unet(), inputs()
    text = some_text()
    plain = network(image, noisy, level, text)
    assert difference(plain, network(1 - image, noisy, level, text)) > 1e-3
    assert difference(plain, network(image, -noisy, level, text)) > 1e-3
    assert difference(plain, network(image, noisy, 1 - level, text)) > 1e-3
    assert difference(plain, network(image, noisy, level, text.flip(0))) > 1e-3


def test_text_acts_on_single_cells() -> None:
    network, given_inputs, text = motion_unet(), inputs(), some_text()
    with torch.no_grad():
        network.pooled_text.weight.zero_()
    change = network(*given_inputs, text) - network(*given_inputs, text.roll(1, 0))
    assert float(change.detach().std((-2, -1)).min()) > 1e-3


def test_padding_changes_nothing() -> None:
    network, (*given_inputs, text) = motion_unet().double(), widened(*inputs(), some_text())
    mask = torch.arange(TOKENS) < torch.tensor([[3], [TOKENS]])
    plain = network(*given_inputs, text, mask)
    other = torch.where(mask[..., None], text, torch.full_like(text, 1e4))
    assert difference(plain, network(*given_inputs, other, mask)) == 0
    assert difference(plain, network(*given_inputs, text)) > 1e-3
    longer = torch.cat([text, torch.ones_like(text)], 1)
    more = torch.cat([mask, torch.zeros_like(mask)], 1)
    torch.testing.assert_close(network(*given_inputs, longer, more), plain, rtol=0, atol=1e-9)


def test_no_text_runs_no_attention(monkeypatch: pytest.MonkeyPatch) -> None:
    network, (*given_inputs, text) = motion_unet().double(), widened(*inputs(), some_text())
    masked = network(*given_inputs, text, torch.zeros(2, TOKENS, dtype=torch.bool))
    empty = network(*given_inputs, text[:, :0])
    monkeypatch.delattr(Attention, "forward")
    alone = network(*given_inputs)
    for without in (masked, empty):
        torch.testing.assert_close(without, alone, rtol=0, atol=1e-9)


def test_the_null_embedding_is_used_without_text_alone() -> None:
    network, given_inputs, text = motion_unet(), inputs(), some_text()
    with_text, alone = network(*given_inputs, text), network(*given_inputs)
    with torch.no_grad():
        network.null_text_embedding.add_(1)
    assert difference(network(*given_inputs, text), with_text) == 0
    assert difference(network(*given_inputs), alone) > 1e-3


def test_frames_interact_and_depend_on_their_time() -> None:
    network, (image, noisy, level) = motion_unet(), inputs(frames=3)
    other = noisy.clone()
    other[:, :, 2] += 1
    plain, changed = network(image, noisy, level), network(image, other, level)
    assert difference(plain[:, :, 0], changed[:, :, 0]) > 1e-3
    alike = network(image, noisy[:, :, :1].expand(-1, -1, 3, -1, -1), level)
    assert difference(alike[:, :, 0], alike[:, :, 2]) > 1e-3


def test_time_is_a_share_of_the_clip() -> None:
    network, (image, noisy, level) = motion_unet(), inputs(frames=1)
    one = network._condition(level, 1, None)
    four = network._condition(level, 4, None).unflatten(0, (2, 4))
    two = network._condition(level, 2, None).unflatten(0, (2, 2))
    torch.testing.assert_close(four[:, 3], one)
    torch.testing.assert_close(four[:, 1], two[:, 0])
    assert bool(network(image, noisy, level).any())


def test_samples_of_a_batch_do_not_interact() -> None:
    network = motion_unet().double()
    image, noisy, level, text = widened(*inputs(3), some_text(3))
    for values in (image, noisy, level, text):
        values[2] = values[0]
    mask = torch.arange(TOKENS) < torch.tensor([[3], [0], [3]])
    together = network(image, noisy, level, text, mask)
    alone = network(image[:1], noisy[:1], level[:1], text[:1], mask[:1])
    torch.testing.assert_close(together[2], together[0], rtol=0, atol=1e-9)
    torch.testing.assert_close(together[:1], alone, rtol=0, atol=1e-9)


def test_coordinates_run_from_edge_to_edge() -> None:
    x, y = cell_coordinates(torch.zeros(2, 3, 1, 2, 4))[1]
    torch.testing.assert_close(x, torch.tensor([[-0.75, -0.25, 0.25, 0.75]] * 2))
    torch.testing.assert_close(y, torch.tensor([[-0.5] * 4, [0.5] * 4]))


@pytest.mark.parametrize("channel", [-2, -1])
def test_coordinates_matter(channel: int) -> None:
    network, given_inputs = motion_unet(), inputs()
    plain = network(*given_inputs)
    with torch.no_grad():
        network.input_image.weight[:, channel] = 0
    assert difference(plain, network(*given_inputs)) > 1e-3


def test_the_attention_mask_is_never_empty() -> None:
    mask = torch.tensor([[True, False], [False, False]])
    tokens = text_tokens(torch.ones(2, 2, 3), mask)
    assert tokens.has_text.tolist() == [True, False]
    assert tokens.attention_mask.tolist() == [[True, False], [True, True]]
    null = torch.full((3,), 7.0)
    assert tokens.pooled(null).tolist() == [[1.0] * 3, [7.0] * 3]


@pytest.mark.parametrize("size", [0.0, 1e4])
@pytest.mark.parametrize("level", [0.0, 1.0])
@pytest.mark.parametrize("real", [0, 1, TOKENS])
def test_extremes_are_finite(size: float, level: float, real: int) -> None:
    network, (image, noisy, _) = motion_unet(), inputs()
    given_inputs = [image.round(), noisy * size, torch.full((2,), level), some_text() * size]
    for values in given_inputs:
        values.requires_grad_()
    output = network(*given_inputs, (torch.arange(TOKENS) < real).expand(2, -1))
    output.sum().backward()
    gradients = [value.grad for value in (*given_inputs, *network.parameters())]
    assert bool(output.isfinite().all())
    assert all(bool(found.isfinite().all()) for found in gradients if found is not None)


def test_wrong_sizes_are_refused() -> None:
    image, noisy, level = inputs()
    network = motion_unet()
    with pytest.raises(ShapeError, match="multiples of 16"):
        network(image[:, :, :24], noisy[:, :, :, :6], level)
    with pytest.raises(ShapeError, match=r"\(8, 4\) cells"):
        network(image, noisy[:, :, :, :4], level)
    with pytest.raises(ShapeError, match="at least one latent frame"):
        network(image, noisy[:, :, :0], level)
    with pytest.raises(ConfigError, match="multiple of 8 for 4 heads"):
        MotionUNet(12, 4, TEXT)


def two_squares() -> tuple[Tensor, Tensor, Tensor]:
    """A red and a blue square, also swapped, and two texts: one says red moves, the other blue."""
    image, target = torch.zeros(4, 3, 32, 32), torch.zeros(4, 3, 2, 8, 8)
    texts = torch.randn(2, TOKENS, TEXT_WIDTH, generator=torch.Generator().manual_seed(0))
    for sample in range(4):
        swapped, moving = divmod(sample, 2)
        for color in range(2):
            left = 16 * (color ^ swapped) + 4
            image[sample, 2 * color, 12:20, left : left + 8] = 1
            if color == moving:
                target[sample, 0, :, 3:5, left // 4 : left // 4 + 2] = 1
    return image, target, texts.repeat(2, 1, 1)


@pytest.mark.slow
def test_it_learns_which_square_the_text_names() -> None:
    image, target, text = two_squares()
    torch.manual_seed(0)
    network = MotionUNet(16, 2, TEXT, frequency_width=16)
    optimiser = torch.optim.Adam(network.parameters(), lr=3e-3)
    losses = []
    for _ in range(80):
        optimiser.zero_grad()
        output = network(image, torch.randn_like(target), torch.ones(4), text)
        loss = (output - target).square().mean()
        loss.backward()
        optimiser.step()
        losses.append(float(loss.detach()))
    # Half is what a network reaches that ignores the text.
    assert losses[-1] < losses[0] / 3


def readings(network: MotionUNet, text: Tensor, mask: Tensor | None = None) -> list[Tensor]:
    return network.text_readings(text, mask, torch.Generator().manual_seed(3))


@torch.no_grad()
def test_readings_are_what_a_text_adds_to_the_condition_and_to_features() -> None:
    network, text = motion_unet(), some_text()
    condition, *added = readings(network, text)
    assert condition.shape[0] == 2 and len(added) == 3
    random = torch.Generator().manual_seed(3)
    tokens = network._adapt(text_tokens(text, None))
    for level, found in zip((network.fine, network.middle, network.coarse), added, strict=True):
        width = len(level.text_attention.norm.gain)
        features = torch.randn(width, RANDOM_CELLS, 1, generator=random).expand(2, -1, -1, -1)
        expected = level.text_attention(features, tokens) - features
        torch.testing.assert_close(found, expected.flatten(1), rtol=1e-3, atol=1e-5)
        assert bool((found[0] != found[1]).any())


@torch.no_grad()
def test_readings_of_padded_and_empty_texts() -> None:
    network, text = motion_unet(), some_text()
    mask = torch.ones(2, TOKENS, dtype=torch.bool)
    mask[0, 3:], mask[1] = False, False
    padded = readings(network, text, mask)
    short = readings(network, text[:1, :3])
    for one, other in zip(padded, short, strict=True):
        torch.testing.assert_close(one[:1], other)
    assert not any(bool(added[1].any()) for added in padded[1:])


def test_a_fresh_mask_input_changes_nothing_and_zeros_are_no_mask() -> None:
    torch.manual_seed(0)
    network = randomised(MotionUNet(8, 2, TEXT, frequency_width=16, object_mask=True))
    given_inputs, mask = inputs(), torch.zeros(2, 32, 16)
    without = network(*given_inputs, some_text())
    assert torch.equal(network(*given_inputs, some_text(), None, mask), without)
    mask[0, 4:12, 4:12] = 1
    shown = network(*given_inputs, some_text(), None, mask)
    assert difference(shown[0], without[0]) > 1e-3
    torch.testing.assert_close(shown[1], without[1])
    torch.nn.init.zeros_(network.input_mask.weight)
    assert torch.equal(network(*given_inputs, some_text(), None, mask), without)


def test_a_network_without_a_mask_input_takes_no_notice_of_masks() -> None:
    network, given_inputs = motion_unet(), inputs()
    shown = network(*given_inputs, some_text(), None, torch.ones(2, 32, 16))
    assert torch.equal(shown, network(*given_inputs, some_text()))
