import numpy as np
import pytest

from diff4splat.captions.vocabulary import UNNAMED
from diff4splat.data_prep.synthetic.materials import ROLES
from diff4splat.data_prep.synthetic.rng import Rng
from diff4splat.data_prep.synthetic.shapes.registry import COMPOSITE, FAMILIES, OF_NO_SPLIT
from diff4splat.data_prep.synthetic.shapes.shape import Shape
from diff4splat.data_prep.synthetic.shapes.surfaces.facets import box, ear_clipped, extruded
from diff4splat.data_prep.synthetic.shapes.surfaces.revolve import ball, rod, superquadric
from diff4splat.data_prep.synthetic.shapes.surfaces.surface import (
    Surface,
    signed_volume,
    vertex_normals,
)
from diff4splat.data_prep.synthetic.shapes.surfaces.sweep import lump, torus, tube

OPEN_ROLES = {"leaf", "grass", "petal", "needle"}
"""Leaves and blades are single polygons."""


def edge_balance(piece: Surface) -> tuple[int, int]:
    """(directed edges without their opposite, directed edges seen twice), after welding places."""
    places = np.round(piece.vertices * 1e7).astype(np.int64)
    _, number = np.unique(places, axis=0, return_inverse=True)
    triangles = number[piece.triangles]
    a, b, c = triangles.T
    triangles = triangles[(a != b) & (b != c) & (c != a)]
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    codes, counts = np.unique(edges[:, 0] * (1 << 32) + edges[:, 1], return_counts=True)
    back = (codes & 0xFFFFFFFF) * (1 << 32) + (codes >> 32)
    return int((~np.isin(codes, back)).sum()), int((counts > 1).sum())


@pytest.mark.parametrize("name", FAMILIES)
def test_every_family_is_well_made(name: str) -> None:
    for seed in range(2):
        least = 12 if name == COMPOSITE else 21
        assert_well_made(FAMILIES[name].make(Rng("shape", seed)).of_height(1.0), least)


def assert_well_made(shape: Shape, least_triangles: int) -> None:
    assert shape.height == pytest.approx(1.0)
    assert shape.bounds[1][1] == pytest.approx(0.0, abs=1e-9)
    assert 0.1 < shape.radius < 8
    assert least_triangles <= shape.triangles < 4000
    for part in shape.parts:
        piece = part.surface
        assert part.role in ROLES
        assert np.isfinite(piece.vertices).all() and np.isfinite(piece.uv).all()
        assert piece.triangles.min() >= 0 and piece.triangles.max() < len(piece.vertices)
        assert piece.uv.shape == (len(piece.vertices), 2)
        assert piece.joint.min() >= 0 and piece.joint.max() <= len(shape.joints)
        if part.role not in OPEN_ROLES:
            assert signed_volume(piece) > 0


def test_bodies_are_closed_and_consistent() -> None:
    leaking = [
        (name, part.role)
        for name in FAMILIES.keys() - {"flag", "towel", "banner"}
        for part in FAMILIES[name].make(Rng("closed")).parts
        if part.role not in OPEN_ROLES and edge_balance(part.surface)[0] != 0
    ]
    assert not leaking


def test_no_triangle_is_degenerate() -> None:
    for name, family in FAMILIES.items():
        for part in family.make(Rng("area")).of_height(1.0).parts:
            a, b, c = (part.surface.vertices[part.surface.triangles[:, k]] for k in range(3))
            area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
            assert (area > 1e-12).mean() > 0.97, name


def test_volumes_against_formulas() -> None:
    assert signed_volume(ball(0.5, 64)) == pytest.approx(np.pi / 6, rel=5e-3)
    assert signed_volume(rod(0.5, 2.0, segments=64)) == pytest.approx(np.pi / 2, rel=5e-3)
    assert signed_volume(torus(1.0, 0.3, (64, 48))) == pytest.approx(2 * np.pi**2 * 0.09, rel=1e-2)
    assert signed_volume(box((1.0, 2.0, 3.0), 1e-4)) == pytest.approx(6.0, rel=1e-3)
    assert signed_volume(superquadric((1.0, 1.0), 64)) == pytest.approx(np.pi / 6, rel=6e-3)
    path = np.array([[0.0, 0, 0], [1.0, 0, 0], [2.0, 0, 0]])
    assert signed_volume(tube(path, np.full(3, 0.1), 64)) == pytest.approx(0.02 * np.pi, rel=1e-2)


def test_texture_coordinates_are_metres() -> None:
    for piece in (box((1.0, 2.0, 3.0)), ball(0.5, 48), rod(0.4, 1.0, bevel=0.05)):
        a, b, c = (piece.triangles[:, k] for k in range(3))
        area = np.linalg.norm(
            np.cross(piece.vertices[b] - piece.vertices[a], piece.vertices[c] - piece.vertices[a]),
            axis=1,
        )
        u, v = piece.uv[b] - piece.uv[a], piece.uv[c] - piece.uv[a]
        flat = np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])
        assert flat.sum() == pytest.approx(area.sum(), rel=0.35)


def test_scaling_scales_texture_coordinates_and_pivots() -> None:
    shape = FAMILIES["quadruped"].make(Rng("q"))
    once, twice = shape.of_height(1.0), shape.of_height(2.0)
    assert np.allclose(2 * once.parts[0].surface.uv, twice.parts[0].surface.uv)
    assert np.allclose(2 * np.array(once.joints[0].pivot), twice.joints[0].pivot)


def test_ear_clipping_covers_the_polygon() -> None:
    outline = np.array([(0, 0), (2, 0), (2, 2), (1, 0.5), (0, 2)], np.float64)
    triangles = ear_clipped(outline)
    assert len(triangles) == 3
    total = 0.0
    for i, j, k in triangles:
        u, v = outline[j] - outline[i], outline[k] - outline[i]
        area = 0.5 * (u[0] * v[1] - u[1] * v[0])
        assert area > 0
        total += area
    assert total == pytest.approx(2.5)
    assert signed_volume(extruded(outline, 1.0, 0.001)) == pytest.approx(2.5, rel=0.01)


def test_normals_point_outward() -> None:
    piece = lump(Rng("l"), roughness=0.0)
    assert np.allclose(vertex_normals(piece.vertices, piece.triangles), piece.vertices, atol=0.02)


def test_there_are_many_families_with_names_of_their_own() -> None:
    assert len(FAMILIES) >= 14
    named = FAMILIES.keys() - OF_NO_SPLIT
    assert len({FAMILIES[name].noun for name in named} - {UNNAMED}) == len(named)
    assert {FAMILIES[name].noun for name in OF_NO_SPLIT} == {UNNAMED}
    assert all(low < high for f in FAMILIES.values() for low, high in f.heights_m)
