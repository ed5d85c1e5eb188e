"""Convex parts of rocks, and soil nodes under rocks."""

import numpy as np
import pytest
import trimesh
from scipy.spatial import ConvexHull, KDTree

from polarsim.rover.world.hulls import DEVIATION_M, convex_parts
from polarsim.rover.world.mesh_heights import under_rocks
from polarsim.rover.world.stitch import TerrainSolids, stitch
from tests.rover.made_world import SMALL, ball, plane


def test_nodes_under_a_rock_are_marked():
    world = stitch([TerrainSolids(4, plane(0.0), {7: ball(0, 0, 0)}), TerrainSolids(1, plane(0.0), {})], SMALL)
    y, x = np.meshgrid(world.y, world.x, indexing="ij")
    distance = np.hypot(x - 1.75, y)
    under = under_rocks(world)
    assert under[distance < 0.085].all()
    assert not under[distance > 0.1].any()


def test_a_convex_rock_is_one_part():
    rock = ball(0, 0, 0)
    ((corners, deviation),) = convex_parts(rock.vertices, rock.faces)
    assert len(corners) == len(rock.vertices)
    assert deviation < 1e-9


def bent() -> trimesh.Trimesh:
    """Return two blocks on a plate with a gap between them, which a convex hull would fill."""
    pieces = [((0.4, 0.1, 0.02), 0.0, 0.01), ((0.1, 0.1, 0.2), -0.15, 0.1), ((0.1, 0.1, 0.2), 0.15, 0.1)]
    return trimesh.util.concatenate(
        [
            trimesh.creation.box(extents, transform=trimesh.transformations.translation_matrix([x, 0, z]))
            .subdivide()
            .subdivide()
            for extents, x, z in pieces
        ]
    )


def test_a_hollow_rock_is_split_until_hulls_leave_the_hollow_free():
    mesh = bent()
    parts = [corners for corners, _ in convex_parts(mesh.vertices, mesh.faces)]
    assert 1 < len(parts) <= 16
    # At the centre of the gap, hulls are lower than the hull of the entire rock, 0.2 m.
    tops = []
    for part in parts:
        hull = trimesh.convex.convex_hull(part)
        hits = hull.ray.intersects_location([[0.0, 0.01, 1.0]], [[0.0, 0.0, -1.0]])[0]
        tops += [hit[2] for hit in hits]
    assert max(tops) < 0.02 + DEVIATION_M + 1e-3
    corners = np.concatenate(parts)
    np.testing.assert_allclose(corners.min(axis=0), mesh.vertices.min(axis=0))
    np.testing.assert_allclose(corners.max(axis=0), mesh.vertices.max(axis=0))


def test_the_number_of_parts_is_limited():
    mesh = bent()
    parts = convex_parts(mesh.vertices, mesh.faces, 1e-6, 3)
    assert len(parts) == 3
    assert max(deviation for _, deviation in parts) > 1e-6  # and is reported


def bumpy(random: np.random.Generator) -> trimesh.Trimesh:
    """Return a rock with hollows: a sphere of 0.12 m with waves of the radius."""
    mesh = trimesh.creation.icosphere(3, 0.12)
    waves = random.uniform(-5, 5, (3, 3)), random.uniform(0, 6.3, 3)
    mesh.vertices *= (1 + 0.1 * np.sin(mesh.vertices / 0.12 @ waves[0].T + waves[1]).sum(axis=1))[:, None]
    return mesh


@pytest.mark.parametrize("seed", range(3))
def test_the_deviation_of_parts_from_the_mesh_is_bounded(seed):
    """Measure random points of the parts that are open from above or from the side, independently."""
    mesh, random = bumpy(np.random.default_rng(seed)), np.random.default_rng(seed + 10)
    parts = convex_parts(mesh.vertices, mesh.faces)
    assert len(parts) > 3
    assert max(deviation for _, deviation in parts) <= DEVIATION_M
    hulls = [ConvexHull(corners) for corners, _ in parts]
    far = []
    for hull in hulls:
        facets = np.flatnonzero(hull.equations[:, 2] > -0.5)
        rows = random.choice(facets, 300)
        points = np.einsum("nk,nkd->nd", random.dirichlet([1, 1, 1], 300), hull.points[hull.simplices[rows]])
        normals = hull.equations[rows, :3]
        sidewards = normals * [1, 1, 0] + [1e-9, 0, 0]
        free = ~np.all(
            [
                mesh.ray.intersects_any(points + 1e-4 * normals, way)
                for way in (np.tile([0, 0, 1.0], (300, 1)), sidewards)
            ],
            axis=0,
        )
        within = [
            (points @ other.equations[:, :3].T + other.equations[:, 3] < -1e-6).all(axis=1)
            for other in hulls
            if other is not hull
        ]
        far.append(points[free & ~np.any(within, axis=0)])
    points = np.concatenate(far)
    assert len(points) > 500
    corners = mesh.vertices[mesh.faces]
    samples = np.concatenate(
        [np.einsum("k,fkd->fd", weights, corners) for weights in random.dirichlet([1, 1, 1], 200)] + [mesh.vertices]
    )
    distance = KDTree(samples).query(points)[0]
    assert distance.max() < DEVIATION_M + 1e-3  # half a millimetre between points, as much for the samples
    inside = np.any(
        [(mesh.vertices @ h.equations[:, :3].T + h.equations[:, 3] < 1e-9).all(axis=1) for h in hulls], axis=0
    )
    assert inside.all()  # parts contain the mesh
