"""Objects of many links: snakes, caterpillars and robot arms."""

import numpy as np

from diff4splat.data_prep.synthetic.rng import Rng
from diff4splat.data_prep.synthetic.shapes.shape import Joint, Part, Shape, several
from diff4splat.data_prep.synthetic.shapes.surfaces.facets import box
from diff4splat.data_prep.synthetic.shapes.surfaces.revolve import ball, rod
from diff4splat.data_prep.synthetic.shapes.surfaces.surface import about_x, merged
from diff4splat.data_prep.synthetic.shapes.surfaces.sweep import tube


def make_snake(rng: Rng) -> Shape:
    """A snake stretched out along x with its head at the front."""
    thick = rng.uniform(0.55, 0.8)
    s = np.linspace(0, 1, 40)
    length = rng.uniform(7.0, 10.0)
    radius = 0.5 * thick * np.clip(np.minimum(3.5 * s, 1.0), 0.06, 1)
    radius *= 1 - 0.35 * np.exp(-(((s - 0.88) / 0.04) ** 2))
    radius[-4:] *= [1.25, 1.2, 0.9, 0.35]
    height = -0.5 * thick - 0.45 * np.clip((s - 0.86) / 0.14, 0, 1) ** 1.5
    path = np.stack([length * (s - 0.5), height, 0 * s], -1)
    head = path[-3]
    eyes = [
        ball(0.09, 8).at(*(head + np.array([0.12, 0.0, side * 0.28 * thick])).tolist())
        for side in (-1, 1)
    ]
    return several(scales=tube(path, radius, 12), rubber=merged(*eyes))


def make_caterpillar(rng: Rng) -> Shape:
    """A row of soft balls with a head and feelers."""
    count, step = rng.integer(6, 8), 0.72
    rear = -0.5 * step * (count - 1)
    body = [
        ball(0.5 - 0.02 * abs(k - count / 2), 16).at(x=rear + step * k) for k in range(count - 1)
    ]
    head_at = rear + step * (count - 1)
    head = ball(0.56, 18).at(x=head_at, y=-0.08)
    feelers, feet = [], []
    for side in (-1, 1):
        path = np.array(
            [
                [head_at, -1.1, 0.15 * side],
                [head_at + 0.1, -1.35, 0.25 * side],
                [head_at + 0.3, -1.5, 0.3 * side],
            ]
        )
        feelers.append(tube(path, np.array([0.05, 0.045, 0.06]), 6))
        feelers.append(ball(0.09, 8).at(head_at + 0.42, -0.68, 0.2 * side))
    for k in range(count - 1):
        feet += [ball(0.11, 8).at(rear + step * k, 0.0, 0.33 * side) for side in (-1, 1)]
    return several(skin=merged(*body), accent=merged(head), rubber=merged(*feelers, *feet))


def make_robot_arm(rng: Rng) -> Shape:
    """A robot arm of two links with a gripper on a turning foot."""
    first, second = rng.uniform(0.5, 0.6), rng.uniform(0.4, 0.5)
    wide = rng.uniform(0.11, 0.15)
    elbow = (0.0, -0.16 - first, 0.0)
    wrist = (second, elbow[1], 0.0)
    foot = merged(rod(0.26, 0.08, bevel=0.02, segments=22), rod(0.15, 0.16, segments=18))
    upper = box((wide, first, wide), 0.03).at(y=-0.16).on_joint(2)
    fore = box((second, 0.8 * wide, 0.8 * wide), 0.03).at(x=second / 2, y=elbow[1] + 0.4 * wide)
    fingers = [
        box((0.16, 0.03, 0.06), 0.008).at(second + 0.1, elbow[1] + dy + 0.015, 0.0).on_joint(4)
        for dy in (-0.06, 0.06)
    ]
    axle = rod(0.62 * wide, 1.5 * wide, bevel=0.01, segments=16).turned(about_x(np.pi / 2))
    hubs = [
        axle.at(point[0], point[1], -0.75 * wide).on_joint(joint)
        for joint, point in ((1, (0.0, -0.16, 0.0)), (2, elbow), (3, wrist))
    ]
    body = merged(foot.on_joint(1), upper, fore.on_joint(3))
    joints = (
        Joint(name="turn", parent=0, pivot=(0.0, 0.0, 0.0), axis=(0.0, 1.0, 0.0)),
        Joint(name="shoulder", parent=1, pivot=(0.0, -0.16, 0.0), axis=(0.0, 0.0, 1.0)),
        Joint(name="elbow", parent=2, pivot=elbow, axis=(0.0, 0.0, 1.0)),
        Joint(name="wrist", parent=3, pivot=wrist, axis=(0.0, 0.0, 1.0)),
    )
    parts = (
        Part(role="machine", surface=body),
        Part(role="metal", surface=merged(*hubs, *fingers)),
    )
    return Shape(parts=parts, joints=joints)
