from functools import cache

import numpy as np
import pytest

from polarsim.analog.ground import make_ground
from polarsim.analog.placement import place_rocks
from polarsim.analog.presets import PRESETS
from polarsim.analog.rays import RayCaster
from polarsim.analog.rocks import carve, icosphere
from polarsim.analog.terrain import build_terrain
from polarsim.site import polar
from polarsim.site_parts import Sandbox


@cache
def placed(terrain):
    """Ground and rocks of a terrain."""
    sandbox = polar().sandbox_of(terrain)
    ground = make_ground(PRESETS[terrain], sandbox.half_width_m, 0.02, np.random.default_rng(terrain))
    return ground, place_rocks(PRESETS[terrain], sandbox, ground, np.random.default_rng(terrain), 3)


def caster(rock):
    return RayCaster(rock.vertices, icosphere(3)[1])


def face_normals(vertices, faces):
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return np.cross(b - a, c - a) / 2, a


def test_the_icosphere_is_closed_and_coarser_ones_come_first():
    vertices, faces = icosphere(3)
    assert len(vertices) == 10 * 4**3 + 2
    assert len(faces) == 20 * 4**3
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    assert len(np.unique(edges, axis=0)) == len(edges)  # each direction of an edge occurs once: closed and oriented
    assert {tuple(e) for e in edges} == {(b, a) for a, b in edges}
    np.testing.assert_allclose(np.linalg.norm(vertices, axis=1), 1)
    np.testing.assert_array_equal(vertices[:162], icosphere(2)[0])


@pytest.mark.parametrize(("seed", "size"), [(0, 0.05), (1, 0.2), (2, 0.6), (3, 0.1)])
def test_a_carved_rock_has_the_given_size_and_outward_faces(seed, size):
    rock = carve(np.random.default_rng(seed), 1, size, 3)
    assert np.ptp(rock.vertices, axis=0).max() == pytest.approx(size)
    areas, corner = face_normals(rock.vertices, icosphere(3)[1])
    volume = np.einsum("ij,ij->", areas, corner) / 3
    assert 0.05 * size**3 < volume < 0.52 * size**3  # pi / 6 for a ball


def test_rocks_are_angular_not_round():
    """A large part of the surface of a rock belongs to a few facets, but only a small part of a ball."""

    def share_on_facets(vertices):
        areas, _ = face_normals(vertices, icosphere(3)[1])
        weight = np.linalg.norm(areas, axis=1)
        normals = areas / weight[:, None]
        near = normals @ normals.T > np.cos(np.radians(12))
        rest, total = weight.copy(), 0.0
        for _ in range(8):
            best = int(np.argmax(near @ rest))
            total += (near[best] * rest).sum()
            rest[near[best]] = 0
        return total / weight.sum()

    ball = share_on_facets(icosphere(3)[0])
    rocks = [share_on_facets(carve(np.random.default_rng(s), 1, 0.2, 3).vertices) for s in range(5)]
    assert ball < 0.1
    assert np.median(rocks) > 2 * ball


@pytest.mark.parametrize("terrain", [5, 7, 8, 9, 10, 11, 12, 13])  # all layouts
def test_rocks_are_in_the_sand_do_not_overlap_and_have_the_sizes_of_the_preset(terrain):
    preset, (ground, rocks) = PRESETS[terrain], placed(terrain)
    assert [rock.rock for rock in rocks] == list(range(1, preset.rocks + 1))
    sizes = [np.ptp(rock.vertices, axis=0).max() for rock in rocks]
    assert min(sizes) >= 0.9 * preset.sizes[0]
    assert max(sizes) <= 1.01 * preset.sizes[2]
    high = 0
    for rock in rocks:
        bottom = rock.vertices[np.argmin(rock.vertices[:, 2])]
        high += bottom[2] > ground.height_at(bottom[:1], bottom[1:2])[0]
        assert np.abs(rock.centre[:2]).max() < 1.9
        assert rock.vertices[:, 2].max() > ground.height_at(*rock.centre[:2, None])[0] + 0.005  # above the sand
    assert high <= preset.stacked  # only stacked rocks are above the sand
    casters = [caster(rock) for rock in rocks]
    for rock in rocks:
        for other, surfaces in zip(rocks, casters, strict=True):
            reach = other.radius + rock.radius + 0.2
            if other is not rock and np.linalg.norm(other.centre - rock.centre) < reach:
                assert surfaces.signed_distance(rock.vertices).min() > -0.012


def test_stacked_rocks_touch_a_rock_below():
    _, rocks = placed(8)
    lifted = [rock for rock in rocks if rock.vertices[:, 2].min() > 0.05]
    assert lifted
    for rock in lifted:
        assert min(caster(other).signed_distance(rock.vertices).min() for other in rocks if other is not rock) < 0.005


def test_some_rocks_are_about_half_buried():
    ground, rocks = placed(5)
    buried = [
        (ground.height_at(*rock.centre[:2, None])[0] - rock.vertices[:, 2].min()) / np.ptp(rock.vertices[:, 2])
        for rock in rocks
    ]
    assert sum(0.3 < share < 0.7 for share in buried) >= 3
    assert sum(share < 0.25 for share in buried) >= 10


def test_terrain_2_is_terrain_1_with_one_more_rock(coarse):
    first, second = (build_terrain(polar(), terrain, coarse).scene for terrain in (1, 2))
    assert len(second.rocks) == len(first.rocks) + 1
    np.testing.assert_array_equal(second.rocks[3].vertices, first.rocks[3].vertices)
    assert np.ptp(second.rocks[-1].vertices, axis=0).max() > 0.5


@pytest.mark.parametrize("terrain", [3, 10])
def test_a_larger_yard_has_more_rocks_over_its_whole_area(terrain):
    preset, sandbox = PRESETS[terrain], Sandbox(half_width_m=(2.0, 4.0))
    ground = make_ground(preset, sandbox.half_width_m, 0.05, np.random.default_rng(1))
    rocks = place_rocks(preset, sandbox, ground, np.random.default_rng(1), 2)
    assert len(rocks) == 2 * preset.rocks
    centres = np.array([rock.centre[:2] for rock in rocks])
    assert (np.abs(centres) < [1.9, 3.8]).all()
    assert (np.ptp(centres, axis=0) > [2.0, 4.0]).all()
