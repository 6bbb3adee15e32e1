"""Kernel: vertex normals, each triangle weighted by its area."""

from diff4splat.data_prep.synthetic.renderer.jit import kernel
from diff4splat.data_prep.synthetic.renderer.numerics import cross, unit


@kernel
def vertex_normals(positions, triangles, normals):
    """Unit normals into ``normals``; zero where a vertex has no area."""
    normals[:] = 0.0
    for index in range(len(triangles)):
        i, j, k = triangles[index, 0], triangles[index, 1], triangles[index, 2]
        ax, ay, az = positions[i, 0], positions[i, 1], positions[i, 2]
        x, y, z = cross(
            positions[j, 0] - ax, positions[j, 1] - ay, positions[j, 2] - az,
            positions[k, 0] - ax, positions[k, 1] - ay, positions[k, 2] - az,
        )  # fmt: skip
        for corner in range(3):
            to = triangles[index, corner]
            normals[to, 0] += x
            normals[to, 1] += y
            normals[to, 2] += z
    for index in range(len(normals)):
        x, y, z = unit(normals[index, 0], normals[index, 1], normals[index, 2])
        normals[index, 0], normals[index, 1], normals[index, 2] = x, y, z
