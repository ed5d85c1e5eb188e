import numpy as np
import pytest
import trimesh
from scipy.spatial import KDTree

from polarsim.errors import ReconstructionError
from polarsim.formats.ply import Cloud
from polarsim.geometry.meshes import Mesh
from polarsim.geometry.topology import is_watertight, largest_island
from polarsim.rocks import surfaces
from polarsim.rocks.adopt import volume_above
from polarsim.rocks.heights import FloorGrid
from polarsim.rocks.scans import Extent
from polarsim.rocks.solids import decimate_mesh, merged_vertices, volume
from polarsim.rocks.surfaces import closed_rock, closing_points, ground_surface, hull_mesh, sample_hull

GRID = FloorGrid(Extent(-0.3, -0.3, 0.3, 0.3), 0.005)
LEVEL = np.zeros(GRID.shape)
NOTHING_SEEN = np.zeros(GRID.shape, bool)
SCANNERS = np.array([[3.5, 0, 1.5], [0, -3.5, 1.5]])
RADIUS = 0.08
CENTRE = np.array([0.01, -0.02, 0.03])


def as_mesh(other):
    return Mesh(np.array(other.vertices, float), np.array(other.faces, np.int64))


def as_trimesh(mesh):
    return trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)


@pytest.fixture(scope="module")
def seen_ball():
    """Return the part of a ball that two scanners see, above level ground at z = 0."""
    directions = np.array(trimesh.creation.icosphere(subdivisions=5).vertices)
    points = CENTRE + RADIUS * directions
    to_scanners = SCANNERS[None] - points[:, None]
    cosine = (to_scanners * directions[:, None]).sum(axis=-1) / np.linalg.norm(to_scanners, axis=-1)
    seen = (cosine.max(axis=1) > 0.1) & (points[:, 2] > 0.001)
    return Cloud(points[seen], directions[seen])


@pytest.fixture(scope="module")
def ball(seen_ball):
    return closed_rock(seen_ball, GRID, LEVEL, NOTHING_SEEN, SCANNERS, 0.003)


def test_a_rock_is_a_closed_outward_solid_for_trimesh(ball):
    other = as_trimesh(ball)
    assert other.is_watertight
    assert other.is_winding_consistent
    assert other.body_count == 1
    assert other.volume == pytest.approx(volume(ball))
    assert volume(ball) > 0


def test_there_is_no_gap_at_the_ground(ball):
    section = as_trimesh(ball).section([0, 0, 1], [0, 0, -0.002])
    assert section is not None
    assert section.is_closed
    assert ball.vertices[:, 2].min() < -0.010


def test_the_scanned_side_is_accurate_to_half_a_millimetre(ball, seen_ball):
    near = KDTree(seen_ball.points).query(ball.vertices)[0] < 0.003
    error = np.abs(np.linalg.norm(ball.vertices[near] - CENTRE, axis=1) - RADIUS)
    assert near.sum() > 1000
    assert np.median(error) < 0.0005


def test_the_hidden_back_completes_the_volume_of_the_ball(ball):
    height = RADIUS + CENTRE[2]
    cap = np.pi * height**2 * (RADIUS - height / 3)  # cut off by the ground
    assert volume_above(ball, GRID, LEVEL) == pytest.approx(cap, rel=0.12)


def test_the_same_cloud_gives_the_same_bytes(ball, seen_ball):
    again = closed_rock(seen_ball, GRID, LEVEL, NOTHING_SEEN, SCANNERS, 0.003)
    assert again.vertices.tobytes() == ball.vertices.tobytes()
    assert again.faces.tobytes() == ball.faces.tobytes()


@pytest.fixture
def torn(monkeypatch):
    """Tear a number of surfaces; return the list of the cells of all surfaces."""

    def tear(number: int) -> list[float]:
        sound, cells = surfaces.poisson, []

        def torn_at_first(cloud, cell):
            mesh = sound(cloud, cell)
            cells.append(cell)
            return Mesh(mesh.vertices, mesh.faces[5:]) if len(cells) <= number else mesh

        monkeypatch.setattr(surfaces, "poisson", torn_at_first)
        return cells

    return tear


def test_a_rock_gets_the_largest_cell_that_leaves_no_hole(ball, seen_ball, torn, caplog):
    cells = torn(3)
    closed = closed_rock(seen_ball, GRID, LEVEL, NOTHING_SEEN, SCANNERS, 0.004)
    assert cells == pytest.approx([0.004, 0.00388, 0.00376, 0.0032])
    assert "convex hull" not in caplog.text
    assert volume(closed) == pytest.approx(volume(ball), rel=0.05)


def test_a_rock_without_a_closed_surface_gets_a_fine_hull(ball, seen_ball, torn, caplog):
    torn(len(surfaces.CELL_SHARES))
    hull = closed_rock(seen_ball, GRID, LEVEL, NOTHING_SEEN, SCANNERS, 0.003)
    assert "convex hull" in caplog.text
    assert is_watertight(hull.faces)
    assert len(hull.vertices) == pytest.approx(len(ball.vertices), rel=0.3)
    assert volume(hull) == pytest.approx(volume(ball), rel=0.05)


def test_points_on_a_line_are_refused():
    line = np.column_stack([np.linspace(0, 0.1, 20), np.zeros(20), np.full(20, 0.05)])
    with pytest.raises(ReconstructionError, match="20 points"):
        closed_rock(Cloud(line, np.tile([0.0, 0, 1], (20, 1))), GRID, LEVEL, NOTHING_SEEN, SCANNERS, 0.003)


def test_the_ground_is_one_sheet_at_its_heights():
    heights = 0.02 * np.sin(9 * GRID.centres()[..., 0])
    mesh = ground_surface(GRID, heights, 0.01)
    assert np.abs(mesh.vertices[:, 2] - 0.02 * np.sin(9 * mesh.vertices[:, 0])).max() < 0.002
    other = as_trimesh(mesh)
    assert other.body_count == 1
    assert other.face_normals[:, 2].min() > 0
    assert other.area_faces @ other.face_normals[:, 2] == pytest.approx(0.6**2, rel=0.08)  # no holes; a ragged border


def test_a_decimated_solid_stays_closed_and_keeps_its_volume():
    ball = as_mesh(trimesh.creation.icosphere(subdivisions=5))
    copy = decimate_mesh(ball, 0.05)
    assert as_trimesh(copy).is_watertight
    assert len(copy.vertices) == pytest.approx(0.05 * len(ball.vertices), rel=0.1)
    assert volume(copy) == pytest.approx(volume(ball), rel=0.02)


def test_small_components_doubled_and_unused_vertices_are_removed():
    box = as_mesh(trimesh.creation.box())
    soup = box.vertices[box.faces].reshape(-1, 3)  # every triangle with separate corners
    crumb = np.array([[5, 5, 5], [5, 6, 5], [6, 5, 5.0]])
    vertices = np.concatenate([soup, crumb, [[9, 9, 9]]])
    clean = largest_island(merged_vertices(Mesh(vertices, np.arange(len(soup) + 3).reshape(-1, 3))))
    assert len(clean.vertices) == 8
    assert len(clean.faces) == 12
    assert is_watertight(clean.faces)


def test_a_hull_is_outward(rng):
    hull = hull_mesh(rng.normal(size=(50, 3)))
    assert is_watertight(hull.faces)
    assert volume(hull) == pytest.approx(trimesh.convex.convex_hull(hull.vertices).volume)


def test_no_closing_points_above_visible_bare_ground(seen_ball):
    bare = np.linalg.norm(GRID.centres() - CENTRE[:2], axis=-1) > 0.9 * RADIUS
    free = closing_points(seen_ball, GRID, LEVEL, NOTHING_SEEN, SCANNERS, 0.003).points
    kept = closing_points(seen_ball, GRID, LEVEL, bare, SCANNERS, 0.003).points
    over_bare = bare.ravel()[GRID.cell_of(free)]
    assert over_bare.any()
    np.testing.assert_array_equal(kept, free[~over_bare])


def test_points_on_a_hull_are_dense_and_skip_faces_without_area():
    rng = np.random.default_rng(8)
    hull = hull_mesh(rng.normal(size=(40, 3)) * 0.1)
    sliver = Mesh(hull.vertices, np.concatenate([hull.faces[:5], [[0, 0, 1]], hull.faces[5:]]))
    found, spacing = sample_hull(sliver, 0.004), 0.004
    assert np.array_equal(found.points, sample_hull(hull, spacing).points)
    heights = ((hull.vertices[None] - found.points[:, None]) * found.normals[:, None]).sum(axis=2)
    assert heights.max() < 1e-12  # no point of the hull is outside a face
    assert np.sort(-heights, axis=1)[:, 2].max() < 1e-12  # and three corners on it
    near = KDTree(found.points).query(found.points, k=2)[0][:, 1]
    assert near.max() < spacing
    area = sum(np.linalg.norm(np.cross(b - a, c - a)) / 2 for a, b, c in hull.vertices[hull.faces])
    assert len(found) * spacing**2 / 2 > area * 0.5
