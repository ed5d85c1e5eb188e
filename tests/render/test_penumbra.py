import numpy as np
import pytest

from polarsim.geometry.camera import Camera
from polarsim.render.lamps import SUN_RADIUS_DEG, Lamp
from polarsim.render.lighting import visible_share
from polarsim.render.maps import compute_maps
from polarsim.render.olat import render_view
from polarsim.run_files.instances import GROUND, SHADOW_IDS

from .conftest import HEIGHT, SIDE

LAMP = Lamp(np.array([3.0, 0.0, 1.5]), radius_m=0.2)
EDGE = -SIDE / 2  # x of the top edge of the block that casts the end of the shadow, at z = HEIGHT


def shares(surfaces, x, lamp=LAMP, samples=400):
    """Return the visible share of the lamp at points (x, 0, 0) on the sand."""
    points = np.stack([x, np.zeros_like(x), np.zeros_like(x)], axis=1).astype(np.float32)
    to_lamp = (lamp.position - points).astype(np.float32)
    return visible_share(surfaces, points, to_lamp, lamp.radius_m, samples, np.zeros(len(x)))


def end_of_shadow(lamp_x, lamp_z):
    """Return x of the intersection of the sand and the ray from a lamp point over the edge of the block."""
    return EDGE - HEIGHT * (lamp_x - EDGE) / (lamp_z - HEIGHT)


def test_the_width_of_a_penumbra_follows_from_the_disc(surfaces):
    """The disc faces the point, so the highest and lowest disc points are normal to the line of sight."""
    centre = end_of_shadow(*LAMP.position[[0, 2]])
    along = LAMP.position - [centre, 0, 0]
    up = np.array([-along[2], 0, along[0]]) / np.linalg.norm(along) * LAMP.radius_m
    high, low = (end_of_shadow(*(LAMP.position + sign * up)[[0, 2]]) for sign in (1, -1))
    assert high - low > 0.05
    np.testing.assert_allclose(shares(surfaces, np.array([high + 0.01, low - 0.01])), [0, 1])
    np.testing.assert_allclose(shares(surfaces, np.array([centre])), 0.5, atol=0.02)
    inside = shares(surfaces, np.linspace(low, high, 20))
    assert (np.diff(inside) <= 1e-6).all()


def test_a_disc_hidden_to_half_the_radius_shows_a_circular_segment(surfaces):
    """A segment of a disc more than half a radius from the centre has a share of 1 / 3 - sqrt(3) / (4 pi)."""
    centre = end_of_shadow(*LAMP.position[[0, 2]])
    along = LAMP.position - [centre, 0, 0]
    up = np.array([-along[2], 0, along[0]]) / np.linalg.norm(along) * LAMP.radius_m / 2
    x = end_of_shadow(*(LAMP.position + up)[[0, 2]])
    assert shares(surfaces, np.array([x]))[0] == pytest.approx(1 / 3 - np.sqrt(3) / (4 * np.pi), abs=0.02)


def test_an_unoccluded_disc_equals_a_point_lamp(surfaces, above, lens, plain):
    point, disc = (
        render_view(
            surfaces, Camera(above, lens), {"lamp": Lamp(LAMP.position, radius_m=r)}, ["lambert"], None, plain
        ).olat_images
        for r in (0.0, 0.2)
    )
    one, other = point["lambert", "lamp"], disc["lambert", "lamp"]
    soft = (one > 0) != (other > 0)
    assert 0 < soft.mean() < 0.1
    assert (other <= one * (1 + 1e-6) + (one == 0)).all()
    assert np.median(np.abs(other - one)) == 0


def test_ground_below_the_visibility_threshold_is_shadow(surfaces, above, lens, plain, ids_of, monkeypatch):
    maps = compute_maps(surfaces, Camera(above, lens), {"lamp": LAMP}, plain)
    ground, share = maps.ids == GROUND, maps.by_lamp["lamp"].lit
    sizes = []
    for below in (0.05, 0.5, 1.0):
        monkeypatch.setattr("polarsim.render.olat.SHADOW_BELOW", below)
        ids = ids_of(surfaces, above, lens, {"lamp": LAMP})["lamp"]
        np.testing.assert_array_equal(ids[ground] == SHADOW_IDS + 1, share[ground] < below)
        sizes.append((ids == SHADOW_IDS + 1).sum())
    assert sizes[0] < 0.99 * sizes[1] < 0.97 * sizes[2]


def test_shadows_of_a_disc_and_of_its_centre_have_similar_outlines(surfaces, above, lens, ids_of):
    point = Lamp(LAMP.position)
    disc, centre = (ids_of(surfaces, above, lens, {"lamp": lamp})["lamp"] == SHADOW_IDS + 1 for lamp in (LAMP, point))
    assert (disc & centre).sum() > 0.95 * (disc | centre).sum()


def test_the_sun_is_half_a_degree_wide_and_uniform(surfaces):
    sun = Lamp.sun(azimuth_deg=0.0, elevation_deg=30.0)
    points = np.array([[-2.0, 0, 0], [2.0, 2, 0]], np.float32)
    to_lamp, irradiance = sun.light_at(points, falloff=True)
    unit = to_lamp / np.linalg.norm(to_lamp, axis=1, keepdims=True)
    np.testing.assert_allclose(unit, np.tile([np.cos(np.pi / 6), 0, 0.5], (2, 1)), atol=5e-4)
    np.testing.assert_allclose(irradiance, 1)
    end = EDGE - HEIGHT / np.tan(np.radians(30))
    width = HEIGHT * (1 / np.tan(np.radians(30 - SUN_RADIUS_DEG)) - 1 / np.tan(np.radians(30 + SUN_RADIUS_DEG)))
    dark, half, bright = shares(surfaces, np.array([end + width, end, end - width]), sun)
    assert (dark, bright) == (0, 1)
    assert half == pytest.approx(0.5, abs=0.1)


@pytest.mark.parametrize("every", [4, 8])
def test_sparse_and_full_probes_agree(surfaces, every):
    """Points across the shadow: open ground, penumbra, umbra, penumbra, open ground."""
    x = np.linspace(EDGE - 1.2, EDGE + 0.3, 4000)
    points = np.stack([x, np.zeros_like(x), np.zeros_like(x)], axis=1).astype(np.float32)
    to_lamp = (LAMP.position - points).astype(np.float32)
    rotation = np.linspace(0, 40, len(x))
    full, sparse = (visible_share(surfaces, points, to_lamp, 0.2, 16, rotation, step) for step in (1, every))
    soft = (full > 0) & (full < 1)
    assert soft.mean() > 0.02
    np.testing.assert_array_equal(sparse, full)


@pytest.mark.parametrize("count", [0, 1, 2, 9])
def test_sparse_probes_of_few_points(surfaces, count):
    points = np.tile(np.array([[0.9, 0.9, 0.5]], np.float32), (count, 1))
    arguments = (surfaces, points, (LAMP.position - points).astype(np.float32), 0.2, 16, np.zeros(count))
    np.testing.assert_array_equal(visible_share(*arguments, 8), visible_share(*arguments))


def test_sparse_probes_change_few_pixels_of_an_image(surfaces, above, lens, plain):
    def picture(every):
        options = plain.model_copy(update={"lamp_probe_px": every})
        return render_view(surfaces, Camera(above, lens), {"lamp": LAMP}, ["lambert"], ["lamp"], options)

    full, sparse = picture(1), picture(8)
    one, other = full.olat_images["lambert", "lamp"], sparse.olat_images["lambert", "lamp"]
    assert (np.abs(one - other) > 0.1 * np.median(one[one > 0])).mean() < 0.001
    assert (full.ids["lamp"] != sparse.ids["lamp"]).mean() < 0.0005
