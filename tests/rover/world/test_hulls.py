"""Rocks as convex parts, and the soil under them."""

import numpy as np
import trimesh

from polarsim.rover.world.hulls import convex_parts, rock_hulls, under_rocks
from polarsim.rover.world.stitch import Terrain, stitch
from tests.rover.made_world import SMALL, ball, plane


def test_soil_under_a_rock_is_the_rocks():
    world = stitch([Terrain(4, plane(0.0), {7: ball(0, 0, 0)}), Terrain(1, plane(0.0), {})], SMALL)
    y, x = np.meshgrid(world.y, world.x, indexing="ij")
    distance = np.hypot(x - 0.5, y)
    under = under_rocks(world)
    assert under[distance < 0.085].all()
    assert not under[distance > 0.1].any()


def test_a_convex_rock_is_one_part():
    rock = ball(0, 0, 0)
    parts = convex_parts(rock.vertices, rock.faces, 0.01, 8)
    assert len(parts) == 1
    assert len(parts[0]) == len(rock.vertices)


def bent() -> trimesh.Trimesh:
    """Two blocks with a gap between them on a plate: its hull fills the gap."""
    pieces = [((0.4, 0.1, 0.02), 0.0, 0.01), ((0.1, 0.1, 0.2), -0.15, 0.1), ((0.1, 0.1, 0.2), 0.15, 0.1)]
    return trimesh.util.concatenate(
        [
            trimesh.creation.box(extents, transform=trimesh.transformations.translation_matrix([x, 0, z]))
            .subdivide()
            .subdivide()
            for extents, x, z in pieces
        ]
    )


def test_a_hollow_rock_is_split_until_its_hulls_do_not_fill_the_hollow():
    mesh = bent()
    parts = convex_parts(mesh.vertices, mesh.faces, 0.01, 8)
    assert 1 < len(parts) <= 8
    # Over the centre of the gap no hull stands as high as that of the whole did, 0.2 m.
    tops = []
    for part in parts:
        hull = trimesh.convex.convex_hull(part)
        hits = hull.ray.intersects_location([[0.0, 0.01, 1.0]], [[0.0, 0.0, -1.0]])[0]
        tops += [hit[2] for hit in hits]
    assert max(tops) < 0.12
    corners = np.concatenate(parts)
    np.testing.assert_allclose(corners.min(axis=0), mesh.vertices.min(axis=0))
    np.testing.assert_allclose(corners.max(axis=0), mesh.vertices.max(axis=0))


def test_no_more_parts_are_made_than_allowed():
    mesh = bent()
    assert len(convex_parts(mesh.vertices, mesh.faces, 1e-6, 3)) == 3


def test_every_rock_of_a_world_has_a_hull_around_it():
    world = stitch([Terrain(4, plane(0.0), {7: ball(0.1, 0.2, 0)}), Terrain(1, plane(0.0), {3: ball(0, 0, 0)})], SMALL)
    hulls = rock_hulls(world, 0.01, 8)
    assert len(hulls) == 2
    np.testing.assert_allclose([hull.mean(axis=0)[:2] for hull in hulls], world.rocks[["x_m", "y_m"]], atol=2e-3)
