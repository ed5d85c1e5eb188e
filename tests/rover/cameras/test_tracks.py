"""Ruts in images: smooth between nodes, unchanged elsewhere, independent of earlier frames."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from polarsim.rover.cameras.tracks import (
    DEPTH_M,
    TILE,
    GrouserMark,
    NodeGrid,
    Tread,
    WheelTracks,
    marks_of,
    spline_weights,
    stamp_marks,
    tile_faces,
)
from tests.rover.ruts import CELL, hills, rutted, tracks


def heights(own, number):
    return own.mesh(number)[0][:, 2].reshape(own.side, own.side)


@pytest.mark.parametrize("finer", [1, 2, 3, 5])
def test_splines_reproduce_straight_lines(finer):
    weights, derivative = spline_weights(6, finer)
    nodes = 2.0 + 0.3 * np.arange(-1, 8)
    np.testing.assert_allclose(weights @ nodes, 2.0 + 0.3 * np.arange(6 * finer + 1) / finer, atol=1e-9)
    np.testing.assert_allclose(derivative @ nodes, 0.3, atol=1e-9)
    assert weights.min() >= 0  # so that they cannot overshoot


@settings(max_examples=15, deadline=None)
@given(finer=st.integers(1, 5), seed=st.integers(0, 99))
def test_fine_ground_goes_through_the_nodes_and_continues_slopes(finer, seed):
    y, x = np.mgrid[:20, :30] * CELL
    hill = 0.02 * np.sin(8 * x + seed) * np.cos(7 * y)
    lattice = NodeGrid(0.0, 0.0, CELL, hill + 0.1 * x - 0.05 * y)
    fine = lattice.refined(finer)
    np.testing.assert_allclose(fine.level[::finer, ::finer], lattice.level, atol=1e-12)
    y, x = np.mgrid[: fine.level.shape[0], : fine.level.shape[1]] * fine.cell
    true = 0.02 * np.sin(8 * x + seed) * np.cos(7 * y) + 0.1 * x - 0.05 * y
    assert np.abs(fine.level - true).max() < 2e-6  # flat cells are off by 1e-4 in their centre


def test_flat_cells_do_not_show_under_a_low_sun(rng):
    nodes = ndimage.gaussian_filter(rng.normal(0, 1, (60, 60)), 1.5)
    lattice = NodeGrid(0.0, 0.0, CELL, 0.0025 * nodes / nodes.std())
    towards_sun = np.array([np.cos(np.radians(8)), 0, np.sin(np.radians(8))])

    def leap(finer):
        """Return the mean brightness that smooth shading gives faces turned away from the Sun, a visible edge."""
        own = WheelTracks(lattice, np.ones(lattice.level.shape, bool), finer)
        light = []
        for number in range(len(own.tiles)):
            vertices, normals = own.mesh(number)
            corners = vertices[tile_faces(own.side)]
            planes = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
            away = planes @ towards_sun < 0
            light.append((normals[tile_faces(own.side)].mean(axis=1) @ towards_sun)[away])
        return np.maximum(np.concatenate(light), 0).mean()

    assert leap(4) < 0.2 * leap(1)


def test_tiles_with_a_rut_join_without_a_gap():
    lattice = hills()
    own = tracks(lattice)
    own.show(rutted(lattice))
    vertices, normals = (np.concatenate(parts) for parts in zip(*map(own.mesh, range(len(own.tiles))), strict=True))
    _, first, node = np.unique(vertices[:, :2].round(6), axis=0, return_index=True, return_inverse=True)
    assert len(first) < len(vertices)
    np.testing.assert_allclose(vertices[:, 2], vertices[first[node.ravel()], 2], atol=1e-6)
    np.testing.assert_allclose(normals, normals[first[node.ravel()]], atol=1e-6)


def test_levels_at_the_border_of_the_tiles_do_not_change():
    lattice = hills()
    own = tracks(lattice)
    for number, (row, column) in enumerate(own.tiles):  # before the drive, tiles continue the static ground
        window = (slice(3 * row, 3 * row + own.side), slice(3 * column, 3 * column + own.side))
        np.testing.assert_allclose(heights(own, number), own.fine.level[window], atol=1e-12)
    own.show(rutted(lattice))
    covered = own.covered
    assert covered.sum() == len(own.tiles) * (own.side - 1) ** 2
    rim = [n for n, (r, c) in enumerate(own.tiles) if not covered[own.finer * r - 1, own.finer * c]]
    assert rim
    for number in rim:
        row, column = (own.finer * first for first in own.tiles[number])
        before = own.fine.level[row, column : column + own.side]
        np.testing.assert_allclose(heights(own, number)[0], before, atol=1e-12)


def test_normals_are_those_of_the_rendered_surface():
    lattice = hills()
    own = tracks(lattice, finer=8)
    own.show(rutted(lattice))
    number = len(own.tiles) // 2
    z, fine = heights(own, number), CELL / 8
    along_y, along_x = np.gradient(z, fine)
    normals = own.mesh(number)[1].reshape(own.side, own.side, 3)
    inner = (slice(2, -2), slice(2, -2))
    np.testing.assert_allclose((-normals[..., 0] / normals[..., 2])[inner], along_x[inner], atol=0.05)
    np.testing.assert_allclose((-normals[..., 1] / normals[..., 2])[inner], along_y[inner], atol=0.05)


def test_only_tiles_near_a_change_are_rebuilt():
    lattice = hills()
    own = tracks(lattice)
    own.show(rutted(lattice))
    assert own.show(rutted(lattice)) == []
    moved = rutted(lattice)
    moved[45, 80] -= 0.001
    again = own.show(moved)
    assert 0 < len(again) <= 4
    assert any(r <= 45 <= r + TILE and c <= 80 <= c + TILE for r, c in (own.tiles[n] for n in again))


def test_no_wall_of_a_rut_is_steeper_than_the_angle_of_repose():
    lattice = NodeGrid(0, 0, CELL, np.zeros((97, 129)))
    level = lattice.level.copy()
    level[40:50, 30:90] -= 0.05
    own = WheelTracks(lattice, level != 0, 4)
    own.show(level)
    up = min(own.mesh(number)[1][:, 2].min() for number in range(len(own.tiles)))
    assert (
        np.degrees(np.arccos(up)) < 46
    )  # the angle along one axis; sliding along both leaves corners 1.4 times so steep


TREAD = Tread(24, 0.25, 0.2)


@pytest.mark.parametrize("slip", [0.0, 0.3])
def test_spacing_of_prints_follows_rolling_and_slip(slip):
    time = np.linspace(0, 10, 1001)
    spin = 0.8 * time
    centres = np.stack([spin * 0.25 * (1 - slip), 0 * time, 0.25 + 0 * time], axis=1)
    quaternions = np.stack([np.cos(spin / 2), 0 * spin, np.sin(spin / 2), 0 * spin], axis=1)  # turning about y
    marks = marks_of(time, spin, centres, quaternions, np.ones(1001, bool), 24)
    assert marks_of(time, spin, centres, quaternions, np.zeros(1001, bool), 24) == []  # on rock
    gaps = np.diff([event.position[0] for event in marks])
    np.testing.assert_allclose(gaps, TREAD.spacing * (1 - slip), rtol=1e-6)
    np.testing.assert_allclose([event.ahead for event in marks], np.tile([1.0, 0], (len(marks), 1)), atol=1e-9)


def test_a_print_is_a_groove_across_the_rut_and_the_next_wheel_removes_it():
    own = tracks(hills(), finer=4)
    position = np.array([0.5, 1.2])
    stamp_marks(own, [GrouserMark(0, position, np.array([-1.0, 0]))], TREAD)
    fine = CELL / 4
    row, column = np.rint((position[::-1] - [own.lattice.y0, own.lattice.x0]) / fine).astype(int)
    groove = own.marks[1:-1, 1:-1]
    np.testing.assert_allclose(groove[row, column], -DEPTH_M, rtol=0.02)
    assert groove[row + round(0.08 / fine), column] < -0.9 * DEPTH_M  # across
    assert abs(groove[row, column + round(0.03 / fine)]) < 1e-6  # along
    assert own.show(own.lattice.level)
    stamp_marks(own, [GrouserMark(1, position + np.array([TREAD.spacing / 2, 0]), np.array([-1.0, 0]))], TREAD)
    assert abs(groove[row, column + 2]) < 0.01 * DEPTH_M  # was a quarter of the depth
