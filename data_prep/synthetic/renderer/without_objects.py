"""The first image of a world, and the same image without one object: the difference is its shadow.

Axes: ``h w`` pixels.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import UInt8

from diff4splat.data.clip import Clip, View
from diff4splat.data.clip_objects import clip_objects
from diff4splat.data_prep.synthetic.renderer.cameras import RenderCamera, render_camera
from diff4splat.data_prep.synthetic.renderer.clips import as_view
from diff4splat.data_prep.synthetic.renderer.ground_truth.maps import render_ground_truth
from diff4splat.data_prep.synthetic.renderer.image_renderer import Renderer, visible_world_points
from diff4splat.data_prep.synthetic.renderer.settings import DrawSettings
from diff4splat.data_prep.synthetic.renderer.triangle_buffer import build_triangle_buffer
from diff4splat.data_prep.synthetic.rng import Rng
from diff4splat.data_prep.synthetic.world import World

LEAST_SHARE, MOST_SHARE = 0.003, 0.3
"""Of the image, that an object shows which is taken away."""


def draw_without_objects(world: World, count: int, settings: DrawSettings | None = None) -> Clip:
    """A clip of one frame, whose ``count`` views after the first lack one object each.

    All have the camera and the exposure of the first. Where fewer objects can be taken away, the
    last views lack nothing.

    Raises:
        ConfigError, InputError: as ``draw_clip``.
    """
    settings = settings or DrawSettings()
    lens, buffer = render_camera(world.views[0], 0), build_triangle_buffer(world)
    truth = render_ground_truth(buffer, 0, lens, None)
    painter = Renderer(world, buffer, visible_world_points([[truth]], [[lens]]), settings)
    painter.auto_expose(0, lens)
    whole = as_view(world.views[0][:1], painter.render(0, [lens]), [truth], lens)
    taken = chosen_objects(world, truth.instances, count)
    views = [_without(world, instances, painter, lens) for instances in taken]
    return Clip(
        note=world.note,
        times_s=whole.depth.new_tensor(world.times_s[:1].tolist()).double(),
        views=(whole, *views, *[whole] * (count - len(views))),
    )


def chosen_objects(
    world: World, instances: UInt8[np.ndarray, "h w"], count: int
) -> list[tuple[int, ...]]:
    """Parts of at most ``count`` objects, drawn at random from those that fill enough."""
    parts = [one.instances for one in clip_objects(world.note)]
    shares = [np.isin(instances, one).mean() for one in parts]
    fitting = [
        one for one, share in zip(parts, shares, strict=True) if LEAST_SHARE <= share <= MOST_SHARE
    ]
    return Rng("without objects", world.note.identifier).permuted(fitting)[:count]


def _without(world: World, instances: Sequence[int], painter: Renderer, lens: RenderCamera) -> View:
    rest = replace(world, objects=tuple(o for o in world.objects if o.instance not in instances))
    buffer = build_triangle_buffer(rest)
    truth = render_ground_truth(buffer, 0, lens, None)
    return as_view(world.views[0][:1], painter.of(rest, buffer).render(0, [lens]), [truth], lens)
