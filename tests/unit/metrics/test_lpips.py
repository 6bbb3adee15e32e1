import oracles_metrics as oracle
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from diff4splat.errors import ShapeError
from diff4splat.metrics.features.backbones import ALEXNET, VGG16, Backbone, Convolution, MaxPool
from diff4splat.metrics.features.lpips import Lpips
from diff4splat.metrics.features.lpips_weights import expected_shapes

F64 = torch.float64
TINY = Backbone(
    name="tiny",
    slices=((Convolution(0, 3, 4),), (MaxPool(2), Convolution(3, 4, 2))),
    least_px=2,
)


def random_weights(trunk: Backbone, dtype: torch.dtype = F64) -> dict[str, torch.Tensor]:
    """Of the size that keeps activations near 1; heads above 0, as the published ones."""
    weights = {}
    for key, shape in expected_shapes(trunk).items():
        fan = shape[1] * shape[2] * shape[3] if len(shape) == 4 else 1
        weights[key] = torch.randn(shape, dtype=dtype) * (2 / fan) ** 0.5
        if key.startswith("lin"):
            weights[key] = weights[key].abs()
    return weights


def images(size: int, count: int = 2, dtype: torch.dtype = F64) -> torch.Tensor:
    return torch.rand(2, count, 3, size, size + 1, dtype=dtype)


@pytest.mark.parametrize(
    ("trunk", "features", "taps", "size"),
    [
        (VGG16, oracle.vgg16_features, oracle.VGG16_TAPS, 16),
        (ALEXNET, oracle.alexnet_features, oracle.ALEXNET_TAPS, 31),
    ],
)
def test_against_torchvisions_layout_and_the_formula(trunk, features, taps, size: int) -> None:
    layers = features()
    weights = {}
    # The names as the package makes them: slices begin after the tap before.
    for number, (start, stop) in enumerate(zip((-1, *taps), taps, strict=False), 1):
        for index in range(start + 1, stop + 1):
            for key, value in layers[index].state_dict().items():
                weights[f"net.slice{number}.{index}.{key}"] = value
    heads = [torch.rand(channels) for channels in trunk.channels]
    for number, head in enumerate(heads):
        weights[f"lin{number}.model.1.weight"] = head.reshape(1, -1, 1, 1)
    assert set(weights) == set(expected_shapes(trunk))
    image, reference = images(size)
    expected = oracle.lpips(layers, taps, heads, image, reference)
    got = Lpips(trunk, weights).distance(image, reference)
    torch.testing.assert_close(got, torch.tensor(expected, dtype=F64), rtol=1e-6, atol=1e-10)


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 999))
def test_it_is_symmetric_and_not_negative(seed: int) -> None:
    torch.manual_seed(seed)
    image, reference = images(4)
    features = Lpips(TINY, random_weights(TINY))
    there, back = features.distance(image, reference), features.distance(reference, image)
    torch.testing.assert_close(there, back)
    assert (there >= 0).all()


def test_each_pair_stands_for_itself() -> None:
    image, reference = images(5, count=3)
    features = Lpips(TINY, random_weights(TINY))
    together = features.distance(image, reference)
    alone = [features.distance(image[i : i + 1], reference[i : i + 1]) for i in range(3)]
    torch.testing.assert_close(together, torch.cat(alone))


@pytest.mark.parametrize("fill", [None, 0.0, 0.5])
def test_equal_images_have_no_distance_and_no_gradient(fill: float | None) -> None:
    image = images(4)[0] if fill is None else torch.full((1, 3, 4, 5), fill, dtype=F64)
    weights = random_weights(TINY)
    for key in weights:
        if key.endswith("bias"):
            weights[key] = torch.full_like(weights[key], -9.0)
    own = image.clone().requires_grad_()
    distance = Lpips(TINY, weights).distance(own, image)
    distance.sum().backward()
    assert not distance.any()
    assert not own.grad.any()


def test_gradient() -> None:
    image, reference = images(3, count=1)
    image.requires_grad_()
    features = Lpips(TINY, random_weights(TINY))
    assert torch.autograd.gradcheck(lambda own: features.distance(own, reference), image)


def test_weights_are_frozen() -> None:
    weights = {key: value.requires_grad_() for key, value in random_weights(TINY).items()}
    image, reference = images(4)
    Lpips(TINY, weights).distance(image.requires_grad_(), reference).sum().backward()
    assert all(value.grad is None for value in weights.values())


def test_precision_follows_the_images_and_mixed_precision_does_not() -> None:
    features = Lpips(TINY, random_weights(TINY))
    image, reference = images(4)
    full = features.distance(image, reference)
    single = features.distance(image.float(), reference.float())
    assert single.dtype == torch.float32
    torch.testing.assert_close(single.double(), full, rtol=1e-4, atol=1e-6)
    with torch.autocast("cpu", dtype=torch.bfloat16):
        assert torch.equal(features.distance(image.float(), reference.float()), single)
    assert features.distance(image.bfloat16(), reference.bfloat16()).dtype == torch.float32


def test_the_name_tells_weights_apart() -> None:
    one, other = random_weights(TINY), random_weights(TINY)
    assert Lpips(TINY, one).name.startswith("LPIPS-tiny (weights ")
    assert Lpips(TINY, one).name == Lpips(TINY, dict(reversed(one.items()))).name
    assert Lpips(TINY, one).name != Lpips(TINY, other).name


def test_too_small_images() -> None:
    features = Lpips(ALEXNET, random_weights(ALEXNET, torch.float32))
    with pytest.raises(ShapeError, match="LPIPS-alex: expected images of at least 31 px"):
        features.distance(*torch.zeros(2, 1, 3, 30, 64))


@pytest.mark.usefixtures("as_shipped")
def test_shapes_must_agree() -> None:
    with pytest.raises(ShapeError, match=r"image: expected \(2, 3, 4, 4\), got \(1, 3, 4, 4\)"):
        Lpips(TINY, random_weights(TINY)).distance(torch.zeros(1, 3, 4, 4), torch.zeros(2, 3, 4, 4))
