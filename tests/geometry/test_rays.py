import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from polarsim.errors import PolarsimError
from polarsim.geometry import rays_embree
from polarsim.geometry.casters import make_caster
from polarsim.geometry.heightfields import grid_mesh
from polarsim.geometry.rays import NO_FACE, START_OFFSET, CompositeScene

GROUND = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], float), np.array([[0, 1, 2]])
DOWN, UP = [0, 0, -1], [0, 0, 1]
engines = pytest.mark.parametrize("engine", ["numpy", "embree", "taichi"])
fast_engines = pytest.mark.parametrize("engine", ["embree", "taichi"])


def random_scene(rng, triangles=200, rays=5000):
    vertices = rng.normal(size=(3 * triangles, 3))
    faces = np.arange(3 * triangles).reshape(-1, 3)
    return vertices, faces, rng.normal(size=(rays, 3)) * 3, rng.normal(size=(rays, 3))


@engines
@pytest.mark.parametrize(
    ("origin", "direction", "distance"),
    [
        ((0.2, 0.2, 1.5), DOWN, 1.5),
        ((9, 9, 1.5), DOWN, np.inf),  # next to the triangle
        ((0.2, 0.2, 1.5), (0, 0, -0.5), 3.0),  # in lengths of the direction
        ((0.2, 0.2, 1.5), UP, np.inf),  # in the opposite direction
        ((0.2, 0.2, -2), UP, 2.0),  # from below
    ],
)
def test_the_nearest_hit_of_one_ray(engine, origin, direction, distance):
    found, face = make_caster(*GROUND, engine=engine).nearest(np.array([origin], float), np.array([direction], float))
    np.testing.assert_allclose(found, [distance], rtol=1e-6)
    assert face.tolist() == [0 if np.isfinite(distance) else NO_FACE]
    assert face.dtype == np.int64


@engines
def test_hits_include_the_point_on_the_triangle(rng, engine):
    vertices, faces, origins, directions = random_scene(rng)
    cast = make_caster(vertices, faces, engine=engine)
    hit = cast.intersect(origins, directions)
    distance, face = cast.nearest(origins, directions)
    np.testing.assert_array_equal(hit.ray, np.flatnonzero(face >= 0))
    np.testing.assert_array_equal(hit.face, face[hit.ray])
    corners = vertices[faces[hit.face]]
    first = 1 - hit.weights.sum(axis=1)
    position = np.einsum("nk,nkx->nx", np.column_stack([first, hit.weights]), corners)
    np.testing.assert_allclose(position, origins[hit.ray] + distance[hit.ray, None] * directions[hit.ray], atol=1e-4)
    exact = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    np.testing.assert_allclose(hit.normal, exact, atol=1e-4)


@engines
def test_occlusion_is_tested_between_the_start_offset_and_far(engine):
    cast = make_caster(*GROUND, engine=engine)
    heights = np.array([1.0, 1.0, 1.0, 0.0, START_OFFSET / 2, 2 * START_OFFSET, 1.0])
    far = np.array([0.9, 1.1, np.inf, 1.0, 1.0, 1.0, 0.0])
    origins = np.stack([np.full(7, 0.2), np.full(7, 0.2), heights], axis=1)
    occluded = cast.occluded(origins, np.tile(DOWN, (7, 1)), far)
    assert occluded.tolist() == [False, True, True, False, False, True, False]


@engines
def test_occlusion_accepts_a_scalar_far_and_any_direction_length(engine):
    cast = make_caster(*GROUND, engine=engine)
    directions = np.array([[0, 0, -0.01], [0, 0, -1], [0, 0, -100.0]])
    origins = np.tile([0.2, 0.2, 0.5], (3, 1))
    assert cast.occluded(origins, directions, 1.0).tolist() == [False, True, True]


@engines
def test_no_rays_and_no_triangles(engine):
    none = np.zeros((0, 3))
    distance, face = make_caster(*GROUND, engine=engine).nearest(none, none)
    assert distance.shape == face.shape == (0,)
    cast = make_caster(none, np.zeros((0, 3), int), engine=engine)
    distance, face = cast.nearest(np.ones((2, 3)), np.ones((2, 3)))
    assert np.isinf(distance).all()
    assert (face == NO_FACE).all()
    assert not cast.occluded(np.ones((2, 3)), np.ones((2, 3)), np.inf).any()
    hit = cast.intersect(np.zeros((2, 3)), np.ones((2, 3)))
    assert len(hit.ray) == len(hit.face) == 0
    assert hit.weights.shape == (0, 2)


@fast_engines
def test_fast_engines_equal_the_reference(engine, rng):
    vertices, faces, origins, directions = random_scene(rng)
    reference, cast = make_caster(vertices, faces, "numpy"), make_caster(vertices, faces, engine)
    expected, expected_face = reference.nearest(origins, directions)
    distance, face = cast.nearest(origins, directions)
    differ = face != expected_face  # rays through an edge may hit either face in float32
    assert differ.mean() < 1e-3
    np.testing.assert_allclose(distance[~differ], expected[~differ], rtol=2e-5, atol=5e-6)  # observed: 2e-6
    shaded = reference.occluded(origins, directions, 1.0)
    assert 0.05 < shaded.mean() < 0.95
    assert (cast.occluded(origins, directions, 1.0) != shaded).mean() < 1e-3


def closed_grid(side=60):
    """Return vertices and faces of a wavy sheet of 4 m x 4 m with waves of 5 cm."""
    x, y = np.meshgrid(np.linspace(-2, 2, side), np.linspace(-2, 2, side))
    grid = grid_mesh(x, y, 0.05 * np.sin(7 * x) * np.cos(5 * y))
    return grid.vertices, grid.faces


@fast_engines
def test_no_ray_passes_through_a_closed_grid(engine, rng):
    vertices, faces = closed_grid()
    targets = np.stack([*rng.uniform(-1.6, 1.6, (2, 1_000_000)), np.zeros(1_000_000)], axis=1)
    lens = np.tile([3.6, -0.4, 1.5], (len(targets), 1))
    distance, _ = make_caster(vertices, faces, engine).nearest(lens, targets - lens)
    np.testing.assert_allclose(distance, 1.0, atol=0.2)  # the ground is within 5 cm of the targets' plane


@fast_engines
@pytest.mark.parametrize("direction", [(0, 0, -1), (0, 0, -7), (0.3, 0.2, -1), (1e-9, 0, -1), (-1, 0, -0.6)])
def test_no_ray_passes_through_a_vertex_or_an_edge(engine, direction):
    vertices, faces = closed_grid()
    shown = np.abs(vertices[faces]).max(axis=(1, 2)) < 1.5
    corners = vertices.astype(np.float32)[faces[shown]].astype(float)
    targets = np.concatenate([corners.reshape(-1, 3), (corners + np.roll(corners, 1, axis=1)).reshape(-1, 3) / 2])
    directions = np.tile(np.array(direction, float), (len(targets), 1))
    # Steeper than the waves; for a vertical ray, x and y equal those of the vertex exactly.
    origins = targets - 0.25 * directions / np.abs(directions[:, 2:])
    cast = make_caster(vertices, faces, engine)
    assert (cast.nearest(origins, directions)[1] != NO_FACE).all()
    assert cast.occluded(origins, directions, np.inf).all()


@fast_engines
def test_results_do_not_depend_on_threads(engine, rng):
    vertices, faces, origins, directions = random_scene(rng, rays=600_000)
    found = []
    for threads in (1, 2):
        cast = make_caster(vertices, faces, engine, threads)
        found.append((*cast.nearest(origins, directions), cast.occluded(origins, directions, 1.0)))
    for first, second in zip(*found, strict=True):
        np.testing.assert_array_equal(first, second)


def test_packets_of_8_and_16_rays_give_the_same_bits(monkeypatch, rng):
    vertices, faces = closed_grid()
    targets = np.stack([*rng.uniform(-2.2, 2.2, (2, 100_003)), np.zeros(100_003)], axis=1)
    origins = np.tile([3.6, -0.4, 0.6], (len(targets), 1))
    cast, found = make_caster(vertices, faces), []
    for size in (8, 16):
        monkeypatch.setattr(rays_embree, "packet_size", lambda size=size: size)
        hits, occluded = cast.intersect(origins, targets - origins), cast.occluded(origins, targets - origins, 0.99)
        assert 0.05 < occluded.mean() < 0.95
        found.append((hits.ray, hits.distance, hits.face, hits.weights, hits.normal, occluded))
    for first, second in zip(*found, strict=True):
        np.testing.assert_array_equal(first, second)


def test_a_common_origin_equals_repeated_origins(rng):
    vertices, faces, _, directions = random_scene(rng)
    cast, origin = make_caster(vertices, faces), np.array([0.1, 0.2, 3.0])
    same, each = np.broadcast_to(origin, directions.shape), np.tile(origin, (len(directions), 1))
    for mine, expected in zip(cast.nearest(same, directions), cast.nearest(each, directions), strict=True):
        np.testing.assert_array_equal(mine, expected)
    np.testing.assert_array_equal(cast.occluded(same, directions, 2.0), cast.occluded(each, directions, 2.0))


@engines
def test_two_joined_sets_of_triangles(engine):
    vertices, faces, origins, directions = random_scene(np.random.default_rng(3), rays=500)
    whole = make_caster(vertices, faces, engine=engine)
    joined = CompositeScene(
        make_caster(vertices, faces[:150], engine=engine), make_caster(vertices, faces[150:], engine=engine), 150
    )
    for mine, expected in zip(joined.nearest(origins, directions), whole.nearest(origins, directions), strict=True):
        np.testing.assert_array_equal(mine, expected)
    np.testing.assert_array_equal(joined.occluded(origins, directions, 2.0), whole.occluded(origins, directions, 2.0))


@engines
def test_unused_vertices_do_not_matter(engine, rng):
    vertices, faces, origins, directions = random_scene(rng, rays=500)
    among_others = rng.normal(size=(3 * len(vertices), 3))
    among_others[1::3] = vertices
    own = make_caster(among_others, 3 * faces + 1, engine=engine).nearest(origins, directions)
    for mine, expected in zip(
        own, make_caster(vertices, faces, engine=engine).nearest(origins, directions), strict=True
    ):
        np.testing.assert_array_equal(mine, expected)


def test_taichi_casts_from_any_thread(rng):
    vertices, faces, origins, directions = random_scene(rng, rays=2000)
    cast = make_caster(vertices, faces, "taichi")
    expected = cast.nearest(origins, directions)[0]
    with ThreadPoolExecutor(3) as pool:
        for distance, _ in pool.map(lambda _: cast.nearest(origins, directions), range(6)):
            np.testing.assert_array_equal(distance, expected)


FREED_ELSEWHERE = """
import threading, numpy as np
from taichi.lang._ndarray import ScalarNdarray
from polarsim.geometry import taichi_device
from polarsim.geometry.casters import make_caster
from polarsim.geometry.taichi_device import ti

def telling(word, work):
    def told(*args):
        if ti.lang.impl.get_runtime().prog is not None:
            print(word, threading.current_thread() is threading.main_thread())
        return work(*args)
    return told

def cast():
    ground = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], float), np.array([[0, 1, 2]])
    made = make_caster(*ground, "taichi")
    made.nearest(np.array([[0.2, 0.2, 1.5]]), np.array([[0, 0, -1.0]]))
    return made

ScalarNdarray.__del__ = telling("freed", ScalarNdarray.__del__)
taichi_device.ti.reset = telling("left", taichi_device.ti.reset)
cast()
kept = cast()
"""


def test_taichi_frees_its_arrays_and_resets_the_device():
    # On other threads CUDA has no context, and the process would end.
    done = subprocess.run([sys.executable, "-c", FREED_ELSEWHERE], capture_output=True, text=True, check=True)
    told = done.stdout.split("\n")[:-1]
    assert "freed False" in told
    assert "left False" in told
    assert not [line for line in told if line.endswith("True")]


def test_an_unavailable_device_is_an_error(monkeypatch):
    monkeypatch.setattr("polarsim.geometry.taichi_device.device_available", lambda _: False)
    with pytest.raises(PolarsimError):
        make_caster(*GROUND, "taichi", device="vulkan")


def test_a_caster_works_after_a_restart_of_taichi():
    from polarsim.geometry import taichi_device

    cast = make_caster(*GROUND, "taichi")
    down = np.array([[0.2, 0.2, 1.5]]), np.array([DOWN])
    before = cast.nearest(*down)[0]
    began = taichi_device.starts()
    taichi_device.start(threads=2)
    taichi_device.start(threads=1)
    assert taichi_device.starts() > began
    np.testing.assert_array_equal(cast.nearest(*down)[0], before)


def test_an_engine_that_cannot_be_loaded_is_an_error(monkeypatch):
    monkeypatch.setitem(sys.modules, "polarsim.geometry.rays_taichi", None)
    with pytest.raises(ImportError):
        make_caster(*GROUND, "taichi")
