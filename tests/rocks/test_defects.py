"""Defects of open meshes are counted, and closed copies keep the surface."""

import numpy as np
import pytest
import trimesh
from scipy.spatial import KDTree

from polarsim.formats import obj
from polarsim.geometry.meshes import Mesh
from polarsim.geometry.outlines import rim
from polarsim.geometry.topology import is_watertight, part_of_face, remove_unused_vertices
from polarsim.rocks.adopt import cleaned, volume_above
from polarsim.rocks.fitted_ground import fit_ground
from polarsim.rocks.folder import DECIMATED_SHARE
from polarsim.rocks.heights import FloorGrid
from polarsim.rocks.repair import MAX_EXCESS, defect_table, defects, excess, repaired
from polarsim.rocks.scans import Extent
from polarsim.rocks.solids import decimate_mesh
from polarsim.rover.world.hulls import DEVIATION_M, convex_parts
from polarsim.schemas.stages import DEFECTS

RADIUS = 0.08
GRID = FloorGrid(Extent(-0.5, -0.5, 0.5, 0.5), 0.01)
LEVEL = np.zeros(GRID.shape)
SCANNERS = np.array([[3.5, 0, 1.5], [0, -3.5, 1.5]])


def half_ball():
    """Return the upper half of a ball on level ground, open below."""
    ball = trimesh.creation.icosphere(subdivisions=5, radius=RADIUS)
    vertices, faces = np.array(ball.vertices), np.array(ball.faces)
    return remove_unused_vertices(vertices, faces[(vertices[faces][:, :, 2] >= -1e-9).all(axis=1)])


def with_skirt(mesh, reach=0.03):
    """Return the half ball with a level ring of sand around its foot."""
    angle = np.linspace(0, 2 * np.pi, 121)
    inner, outer = (radius * np.column_stack([np.cos(angle), np.sin(angle)]) for radius in (RADIUS, RADIUS + reach))
    ring = np.column_stack([np.concatenate([inner, outer]), np.zeros(2 * len(angle))])
    a = np.arange(len(angle) - 1)
    faces = np.concatenate([np.stack([a, a + 121, a + 1], 1), np.stack([a + 1, a + 121, a + 122], 1)])
    return Mesh(np.concatenate([mesh.vertices, ring]), np.concatenate([mesh.faces, faces + len(mesh.vertices)]))


def test_a_clean_half_ball_is_open_only_at_its_rim():
    found = defects(half_ball())
    assert 1.0 < found["rim_m"] / (2 * np.pi * RADIUS) < 1.2  # zigzag along the triangles
    clean = {
        "unused_vertices": 0,
        "doubled_vertices": 0,
        "islands": 1,
        "small_component_faces": 0,
        "holes": 0,
        "watertight": False,
    }
    assert {name: found[name] for name in clean} == clean
    assert found["skirt_share"] < 0.08  # the lowest 4 of 80 mm


def test_defects_are_counted():
    ball = half_ball()
    top = np.flatnonzero((ball.vertices[ball.faces][:, :, 2] > 0.9 * RADIUS).all(axis=1))
    spoiled = np.delete(ball.faces, top[:1], axis=0)  # a hole
    corner = len(ball.vertices)
    crumb = np.array([[1, 1, 0.1], [1.01, 1, 0.1], [1, 1.01, 0.1]])
    twin = ball.vertices[spoiled[0, 0]][None]
    spoiled[0, 0] = corner + 3  # a separate corner at the same point
    vertices = np.concatenate([ball.vertices, crumb, twin, [[5.0, 5, 5]]])  # the last vertex is unused
    found = defects(Mesh(vertices, np.concatenate([spoiled, [[corner, corner + 1, corner + 2]]])))
    expected = {"unused_vertices": 1, "doubled_vertices": 1, "islands": 2, "small_component_faces": 1, "holes": 1}
    assert {name: found[name] for name in expected} == expected


def test_the_table_has_a_row_for_each_rock():
    table = defect_table({3: half_ball(), 7: with_skirt(half_ball())})
    assert list(table.columns) == list(DEFECTS.columns)
    assert table["rock"].tolist() == [3, 7]
    assert len(defect_table({})) == 0


def test_a_closed_copy_keeps_the_surface_and_loses_the_skirt():
    copy = repaired(with_skirt(half_ball()), GRID, LEVEL, SCANNERS, 0.003)
    assert is_watertight(copy.faces)
    assert part_of_face(copy.faces).max() == 0
    high = copy.vertices[copy.vertices[:, 2] > 0.01]
    assert np.median(np.abs(np.linalg.norm(high, axis=1) - RADIUS)) < 0.0005
    above = copy.vertices[copy.vertices[:, 2] > 0.001]
    assert np.hypot(above[:, 0], above[:, 1]).max() < RADIUS + 0.005
    assert volume_above(copy, GRID, LEVEL) == pytest.approx(2 / 3 * np.pi * RADIUS**3, rel=0.05)


@pytest.mark.parametrize(
    ("move", "beyond"),
    [((0, 0, 0), 0.0), ((0.03, 0, 0), 0.03), ((0, -0.04, 0), 0.04), ((0, 0, 0.05), 0.05), ((0, 0, -1), 0.0)],
)
def test_an_excess_is_upwards_or_sideways(move, beyond):
    ball = half_ball()
    assert excess(Mesh(ball.vertices + move, ball.faces), ball) == pytest.approx(beyond)


@pytest.mark.parametrize("flipped_share", [0.5, 1.0])
def test_inward_faces_do_not_change_a_closed_copy(rng, flipped_share):
    rock = with_skirt(half_ball())
    inward = rng.random(len(rock.faces)) < flipped_share
    spoiled = Mesh(rock.vertices, np.where(inward[:, None], rock.faces[:, ::-1], rock.faces))
    copies = [repaired(mesh, GRID, LEVEL, SCANNERS, 0.003) for mesh in (rock, spoiled)]
    assert np.abs(np.ptp(copies[0].vertices, axis=0) - np.ptp(copies[1].vertices, axis=0)).max() < 1e-6
    assert volume_above(copies[1], GRID, LEVEL) == pytest.approx(volume_above(copies[0], GRID, LEVEL))


@pytest.mark.release
@pytest.mark.parametrize("terrain", [8])
def test_published_rocks_become_closed_solids(release_root, terrain):
    rocks = {
        k: obj.read_obj(p) for k, p in obj.rock_files(release_root / "TerrainMeshes" / f"Terrain{terrain:02d}").items()
    }
    assert not defect_table(rocks)["watertight"].any()  # undersides are not scanned
    adopted = {rock: cleaned(mesh) for rock, mesh in rocks.items()}
    grid = FloorGrid(Extent(-2.1, -2.1, 2.1, 2.1), 0.02)
    ground = fit_ground([rim(mesh) for mesh in adopted.values()], grid)
    for rock, mesh in list(adopted.items())[:4]:
        copy = repaired(mesh, grid, ground, np.array([[3.6, -0.4, 1.5], [0.4, -3.6, 1.5]]), 0.003)
        assert is_watertight(copy.faces), rock
        assert excess(copy, mesh) < MAX_EXCESS
        upper = mesh.vertices[mesh.vertices[:, 2] > np.median(mesh.vertices[:, 2])]
        assert np.median(KDTree(copy.vertices).query(upper)[0]) < 0.002  # vertices of both are millimetres apart
        coarse = decimate_mesh(copy, DECIMATED_SHARE)
        assert max(deviation for _, deviation in convex_parts(coarse.vertices, coarse.faces)) <= DEVIATION_M
