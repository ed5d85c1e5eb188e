"""Convex parts of rocks, and soil nodes under rocks."""

import numpy as np
import pytest
import trimesh
from scipy.spatial import ConvexHull, KDTree

from polarsim.rover.world.hulls import DEVIATION_M, MIN_VOLUME_M3, convex_parts
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


def test_parts_may_be_smaller_than_the_smallest_rock():
    """A deviation of half a millimetre requires parts of a few triangles of 10 mm2, which are flat."""
    mesh = bumpy(np.random.default_rng(0))
    parts = convex_parts(mesh.vertices / 4, mesh.faces, 0.0005, 1000)
    assert max(deviation for _, deviation in parts) <= 0.0005
    assert min(ConvexHull(corners).volume for corners, _ in parts) < MIN_VOLUME_M3


def opened(mesh: trimesh.Trimesh, random: np.random.Generator) -> trimesh.Trimesh:
    """Return a rock as scans give it: without its underside, and with normals inwards on most faces."""
    faces = mesh.faces[mesh.triangles_center[:, 2] > -0.08].copy()
    flipped = random.random(len(faces)) < 0.8
    faces[flipped] = faces[flipped, ::-1]
    return trimesh.Trimesh(mesh.vertices, faces, process=False)


def reachable_surface(mesh: trimesh.Trimesh, hulls: list[ConvexHull], random: np.random.Generator) -> np.ndarray:
    """Return random points (n, 3) on parts, outside other parts, that are open from above or from the side."""
    far = []
    for hull in hulls:
        facets = np.flatnonzero(hull.equations[:, 2] > -0.5)
        rows = random.choice(facets, 2000)
        points = np.einsum("nk,nkd->nd", random.dirichlet([1, 1, 1], 2000), hull.points[hull.simplices[rows]])
        normals = hull.equations[rows, :3]
        sidewards = normals * [1, 1, 0] + [1e-9, 0, 0]
        free = ~np.all(
            [
                mesh.ray.intersects_any(points + 1e-4 * normals, way)
                for way in (np.tile([0, 0, 1.0], (2000, 1)), sidewards)
            ],
            axis=0,
        )
        within = [
            (points @ other.equations[:, :3].T + other.equations[:, 3] < -1e-6).all(axis=1)
            for other in hulls
            if other is not hull
        ]
        far.append(points[free & ~np.any(within, axis=0)])
    return np.concatenate(far)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("is_open", [False, True])
def test_the_deviation_of_parts_from_the_rock_is_bounded(seed, is_open):
    mesh, random = bumpy(np.random.default_rng(seed)), np.random.default_rng(seed + 10)
    used = opened(mesh, random) if is_open else mesh
    parts = convex_parts(used.vertices, used.faces)
    assert len(parts) > 3
    assert max(deviation for _, deviation in parts) <= DEVIATION_M
    hulls = [ConvexHull(corners) for corners, _ in parts]
    points = reachable_surface(mesh, hulls, random)
    points = points[points[:, 2] > -0.06]  # above the opening
    assert len(points) > 1000
    corners = mesh.vertices[mesh.faces]
    samples = np.concatenate(
        [np.einsum("k,fkd->fd", weights, corners) for weights in random.dirichlet([1, 1, 1], 200)] + [mesh.vertices]
    )
    assert KDTree(samples).query(points)[0].max() < DEVIATION_M + 1e-4
    inside = np.any(
        [(used.triangles_center @ h.equations[:, :3].T + h.equations[:, 3] < 1e-9).all(axis=1) for h in hulls], axis=0
    )
    assert inside.all()  # parts contain the mesh


def test_the_orientation_of_faces_does_not_matter():
    mesh = bumpy(np.random.default_rng(0))
    outward, inward = (convex_parts(mesh.vertices, faces) for faces in (mesh.faces, mesh.faces[:, ::-1]))
    assert len(inward) == len(outward)
    for (corners, deviation), (expected, expected_deviation) in zip(inward, outward, strict=True):
        np.testing.assert_array_equal(corners, expected)
        assert deviation == pytest.approx(expected_deviation)


def test_holes_are_filled():
    sphere = trimesh.creation.icosphere(3, 0.1)
    height, angle = sphere.triangles_center[:, 2], np.arctan2(*sphere.triangles_center[:, :2].T)
    shell = sphere.faces[(height > -0.05) & ~((np.abs(angle) < 0.4) & (np.abs(height) < 0.04))]
    ((corners, deviation),) = convex_parts(sphere.vertices, shell)
    assert deviation < 0.001
    assert len(corners) > 100
