"""Textures: finite everywhere, near their colours, never flat, band-limited, 1/f where they say."""

import numpy as np
import oracles_drawing as oracle
import pytest

from diff4splat.data_prep.synthetic.renderer.jit import GROUP, kernel
from diff4splat.data_prep.synthetic.renderer.textures.lettering import FONT
from diff4splat.data_prep.synthetic.renderer.textures.materials import (
    FAMILIES,
    materials_of,
    pattern,
)
from diff4splat.data_prep.synthetic.renderer.triangle_buffer import build_triangle_buffer
from diff4splat.errors import ConfigError


@kernel
def sampled(family, places, footprint, seed, values):
    """Values of a texture at places (n 3)."""
    for index in range(len(places)):
        found = pattern(
            family, places[index, 0], places[index, 1], places[index, 2], footprint, seed
        )
        for at in range(4):
            values[index, at] = found[at]


GROUP.kernels.remove(sampled)


def values_of(family: str, places: np.ndarray, footprint: float = 0.01, seed: int = 5):
    values = np.zeros((len(places), 4))
    sampled(FAMILIES.index(family), np.ascontiguousarray(places), footprint, seed, values)
    return values


def plane(count: int, step: float) -> np.ndarray:
    y, x = np.indices((count, count)) * step + 0.123
    return np.stack([x.ravel(), y.ravel(), np.full(x.size, 0.5)], -1)


@pytest.mark.parametrize("family", FAMILIES)
def test_values_are_shares_and_never_flat(family: str) -> None:
    values = values_of(family, plane(64, 0.07))
    assert np.isfinite(values).all()
    assert (values[:, :2] >= 0).all()
    assert (values[:, :2] <= 1).all()
    assert 0.6 < values[:, 2].mean() < 1.2
    assert values[:, 2].min() > 0
    assert values[:, 2].std() > 0.004


@pytest.mark.parametrize("family", FAMILIES)
def test_huge_coordinates_and_footprints_stay_finite(family: str) -> None:
    places = np.array([[1e300, -1e300, 1e30], [1e9, 1e9, -1e9], [-1e12, 3.0, 0.0], [0.0, 0, 0]])
    for footprint in (0.0, 1e-9, 1.0, 1e30):
        assert np.isfinite(values_of(family, places, footprint)).all()


@pytest.mark.parametrize("family", FAMILIES)
def test_seeds_vary_and_repeat(family: str) -> None:
    places = plane(24, 0.11)
    assert (values_of(family, places) == values_of(family, places)).all()
    assert (values_of(family, places) != values_of(family, places, seed=6)).any()


@pytest.mark.parametrize("family", FAMILIES)
def test_far_away_a_texture_is_nearly_its_mean(family: str) -> None:
    near, far = values_of(family, plane(48, 0.31)), values_of(family, plane(48, 0.31), 6.0)
    assert (far[:, :3].std(0) <= 0.12).all()
    assert np.abs(far[:, :3].mean(0) - near[:, :3].mean(0)).max() < 0.25


def test_noise_has_the_spectrum_of_natural_images() -> None:
    slopes = []
    for seed in range(6):
        image = values_of("noise", plane(128, 1 / 12), 1 / 24, seed)[:, 0].reshape(128, 128)
        window = np.hanning(128)
        spectrum = np.abs(np.fft.fft2((image - image.mean()) * np.outer(window, window)))
        f = np.fft.fftfreq(128) * 128
        radius = np.hypot(f[:, None], f[None])
        bands = [(low, low * 1.5) for low in (4, 6, 9, 13, 20)]
        means = [spectrum[(radius >= low) & (radius < high)].mean() for low, high in bands]
        slopes.append(np.polyfit(np.log([low * 1.22 for low, _ in bands]), np.log(means), 1)[0])
    assert -1.35 < np.mean(slopes) < -0.75


def test_letters_can_be_read() -> None:
    rows = [[format(int(row), "05b").replace("0", ".") for row in FONT[at]] for at in (0, 19, 27)]
    assert rows[0] == [".111.", "1...1", "1...1", "11111", "1...1", "1...1", "1...1"]
    assert rows[1] == ["11111", "..1..", "..1..", "..1..", "..1..", "..1..", "..1.."]
    assert rows[2] == ["..1..", ".11..", "..1..", "..1..", "..1..", "..1..", ".111."]
    assert len({tuple(rows) for rows in FONT.tolist()}) == 36


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"family": "tartan"}, "expected one of plain, noise"),
        ({"colors": np.ones((1, 3))}, "expected 2 to 4 colours, got 1"),
    ],
)
def test_unknown_textures_are_refused(changes: dict, expected: str) -> None:
    shape = oracle.mesh([[0, 0, 2], [1, 0, 2], [0, 1, 2]], [[0, 1, 2]])
    look = oracle.texture(**changes)
    world = oracle.world([oracle.thing(1, shape, look)], [oracle.straight(1)], 1)
    with pytest.raises(ConfigError, match=expected):
        materials_of(build_triangle_buffer(world))
