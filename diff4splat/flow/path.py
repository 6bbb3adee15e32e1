"""The straight path between clean latents and noise.

Axes: ``b`` batch, ``*d`` everything else. ``level`` is the fraction of noise: 0 is data, 1 is pure
noise, so sampling runs from 1 to 0. The literature disagrees on which end is called ``x_0``; that
name is not used here. With the end points of Diff4Splat (arXiv 2511.00503, flow matching section)
the only linear path is

    noisy    = (1 - level) · clean + level · noise
    velocity = d noisy / d level = noise - clean
    clean    = noisy - level · velocity
    noise    = noisy + (1 - level) · velocity
    velocity = (noisy - clean) / level
"""

from jaxtyping import Float
from torch import Tensor

from diff4splat.errors import ShapeError

Level = Float[Tensor, " b"] | float
"""One noise level per batch element, or one for all."""


def add_noise(
    clean: Float[Tensor, "b *d"], noise: Float[Tensor, "b *d"], level: Level
) -> Float[Tensor, "b *d"]:
    """The point at ``level`` on the way from ``clean`` to ``noise``."""
    _require_alike("noise", noise, clean)
    level = _spread(level, clean)
    return (1 - level) * clean + level * noise


def velocity(clean: Float[Tensor, "b *d"], noise: Float[Tensor, "b *d"]) -> Float[Tensor, "b *d"]:
    """The regression target of a flow-matching network: constant along the path."""
    _require_alike("noise", noise, clean)
    return noise - clean


def clean_from_velocity(
    noisy: Float[Tensor, "b *d"], velocity: Float[Tensor, "b *d"], level: Level
) -> Float[Tensor, "b *d"]:
    """Where the straight line through ``noisy`` meets level 0."""
    _require_alike("velocity", velocity, noisy)
    return noisy - _spread(level, noisy) * velocity


def noise_from_velocity(
    noisy: Float[Tensor, "b *d"], velocity: Float[Tensor, "b *d"], level: Level
) -> Float[Tensor, "b *d"]:
    """Where the straight line through ``noisy`` meets level 1."""
    _require_alike("velocity", velocity, noisy)
    return noisy + (1 - _spread(level, noisy)) * velocity


def velocity_from_clean(
    noisy: Float[Tensor, "b *d"], clean: Float[Tensor, "b *d"], level: Float[Tensor, "b *e"]
) -> Float[Tensor, "b *d"]:
    """The velocity that leads to ``clean``; 0 where the level is 0, which is where it leads.

    ``level`` broadcasts against ``noisy``, axis by axis: one per latent frame is (b, 1, t, 1, 1).
    """
    _require_alike("clean", clean, noisy)
    if level.ndim != noisy.ndim:
        raise ShapeError(
            f"level: expected {noisy.ndim} axes as the latents have, got {level.ndim}; "
            "put axes of length 1 in between"
        )
    away = level > 0
    return (noisy - clean) / level.where(away, level.new_ones(())) * away


def _spread(level: Tensor | float, like: Tensor) -> Tensor | float:
    """A level per batch element, shaped to multiply ``like``."""
    if not isinstance(level, Tensor):
        return level
    if level.shape != like.shape[:1]:
        want, got = tuple(like.shape[:1]), tuple(level.shape)
        raise ShapeError(f"level: expected {want}, one per batch element, got {got}")
    return level.reshape(-1, *[1] * (like.ndim - 1))


def _require_alike(what: str, got: Tensor, like: Tensor) -> None:
    # Broadcasting would otherwise turn a missing batch axis into a wrong target without a word.
    if got.shape != like.shape:
        raise ShapeError(f"{what}: expected {tuple(like.shape)}, got {tuple(got.shape)}")
