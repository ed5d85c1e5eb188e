"""Lamps, gain and grey levels of twins of a site that is not NASA's."""

import numpy as np
import pytest

from polarsim.formats import png
from polarsim.photo import BLACK_LEVEL, PhotoKey
from polarsim.photo_format import as_stored
from polarsim.render.brdf import reflectance
from polarsim.render.gain import calibration_photos, default_gain
from polarsim.render.lamps import REFERENCE_DISTANCE, ROVER, first_tripod, lamps_of_rig
from polarsim.render.options import RenderOptions
from polarsim.render.scene import Scene
from polarsim.run_files.rigs import read_localised
from polarsim.site_parts import FAR_M
from tests.support.other_site import other_site

from .conftest import render_into

NEAR = {"position_m": [2.9, 2.9, 0.9]}
FAR = {"kind": "directional", "azimuth_deg": 135, "elevation_deg": 20}


def site(**changes):
    """Return the other site with a lamp near the sand and a directional lamp, and the terrain 1 of the folders."""
    return other_site(
        **{"terrains": [1], "positions": ["A"], "tripods": {}, "lamps": {"45": NEAR, "135": FAR}} | changes
    )


def suns(chosen):
    return {name: np.array(lamp.point) for name, lamp in chosen.lamps.items()}


def test_light_of_a_directional_lamp_does_not_fall_off_with_its_distance(folders):
    rig, chosen = read_localised(folders / "cameras/PosA.json"), site()
    lamps = lamps_of_rig(suns(chosen), rig, chosen)
    points = np.array([[0.0, 0.0, 0.0], [1.4, -2.8, 0.1], [-1.4, 2.8, 0.0]])
    to_lamp, irradiance = lamps["135"].light_at(points, falloff=True)
    np.testing.assert_array_equal(irradiance, 1.0)
    unit = to_lamp / np.linalg.norm(to_lamp, axis=1, keepdims=True)
    assert np.abs(unit - unit[0]).max() < 7 / FAR_M  # parallel over the sand
    assert np.ptp(lamps["45"].light_at(points, falloff=True)[1]) > 0.4


def test_lamps_have_the_radius_of_the_site_or_the_given_one(folders):
    rig = read_localised(folders / "cameras/PosA.json")
    chosen = site(lamps={"45": NEAR | {"radius_m": 0.2}, "135": FAR})
    radii = {radius: lamps_of_rig(suns(chosen), rig, chosen, radius)["45"].radius_m for radius in (None, 0.0, 0.1)}
    assert radii == {None: 0.2, 0.0: 0.0, 0.1: 0.1}


def test_a_site_without_rig_lamp_has_none(folders):
    rig = read_localised(folders / "cameras/PosA.json")
    assert ROVER in lamps_of_rig({}, rig, site())
    assert ROVER not in lamps_of_rig({}, rig, site(rig_lamp=None))


@pytest.mark.parametrize("falloff", [False, True])
@pytest.mark.parametrize("lamps", [{"45": NEAR}, {"135": FAR}, {}])
def test_level_sand_has_the_same_brightness_in_the_usual_exposure_of_any_site(lamps, falloff):
    chosen = site(lamps=lamps, reference_exposure_ms=40)
    options = RenderOptions(falloff=falloff)
    camera = np.array([first_tripod(chosen).camera_m])
    towards = np.array([lamp.point for lamp in chosen.lamps.values()] or camera, float)
    unit = [vector / np.linalg.norm(vector) for vector in (np.array([[0, 0, 1.0]]), towards, camera)]
    light = 1.0 if lamps else chosen.rig_lamp.share
    if falloff and "135" not in lamps:
        light *= REFERENCE_DISTANCE**2 / (towards**2).sum()
    radiance = reflectance(options.parameters("hapke"), *unit)[0] * unit[1][0, 2] * light
    assert default_gain("hapke", options, chosen) * radiance * 40 == pytest.approx(768)


def test_the_calibration_has_a_photo_per_lamp_in_the_order_and_usual_exposure_of_the_site(tmp_path):
    chosen = site(reference_exposure_ms=40)
    keys = [key for key in chosen.photos_of(1) if key.camera == "L"]
    for key in keys:
        png.write_png(tmp_path / f"{key}.png", np.zeros((4, 6), np.uint16))
    found = calibration_photos(tmp_path, keys, chosen)
    assert [str(key) for key in found] == ["01_A_off_45_L_0040", "01_A_off_135_L_0040"]


def test_twins_of_8_bits_have_the_values_that_files_of_the_site_have(folders):
    keys = [PhotoKey.parse(f"01_A_{light}_{sun}_L_0064") for light, sun in (("off", "30"), ("on", "180"))]
    options = RenderOptions(walls=False, bounce=0, falloff=True)
    chosen = site(lamps={"30": NEAR, "180": FAR})
    render_into(folders, {"hapke": folders / "twins"}, keys, options, site=chosen)
    for key in keys:
        twin = png.read_png(folders / "twins" / f"{key}.png")
        assert twin.max() > BLACK_LEVEL + 100
        np.testing.assert_array_equal(twin, as_stored(twin, chosen.images))
        assert len(np.unique(twin)) <= 252  # values 4 to 255


def test_meshes_of_a_terrain_that_polar_does_not_have_are_rendered_without_nominal_walls(folders):
    for path in (folders / "meshes").iterdir():
        path.rename(path.with_name(path.name.replace("terrain01", "terrainyard-a")))
    options = RenderOptions(bounce=0)
    assert Scene(folders / "meshes", "yard-a", options).surfaces.walls is None
    walled = other_site(sandbox={"half_width_m": [1.5, 3.0], "walls_m": dict.fromkeys(("-x", "+x", "-y", "+y"), 0.2)})
    bounds = Scene(folders / "meshes", "yard-a", options, walled).surfaces.walls.bounds
    np.testing.assert_allclose(bounds, [[-1.55, -3.05], [1.55, 3.05]])
