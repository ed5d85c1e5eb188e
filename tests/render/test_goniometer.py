import numpy as np
import pytest

from polarsim.errors import RenderError
from polarsim.formats import png
from polarsim.render.goniometer import directions, parameters_of, phase_deg, reflectance_at
from polarsim.render.options import HAPKE_SETS, MODELS
from polarsim.tables.figures.brdf import draw_brdf


def test_angles_come_back_from_the_vectors():
    normal, to_lamp, to_viewer = directions(30, 70, 120)
    np.testing.assert_allclose(np.degrees(np.arccos((normal * to_lamp).sum())), 30)
    np.testing.assert_allclose(np.degrees(np.arccos((normal * to_viewer).sum())), 70)
    np.testing.assert_allclose(phase_deg(30, 70, 120), np.degrees(np.arccos((to_lamp * to_viewer).sum())))


def test_phase_angles_in_the_plane_of_incidence_are_differences_and_sums():
    np.testing.assert_allclose(phase_deg([30, 30, 30, 89], [20, 20, 30, 89], [0, 180, 0, 180]), [10, 50, 0, 178])


@pytest.mark.parametrize("model", MODELS)
def test_every_model_has_a_reflectance_that_ends_at_the_horizon(model):
    value = reflectance_at(parameters_of(model), np.array([30, 30, 90]), np.array([30, 90, 30]), np.zeros(3))
    assert value[0] > 0
    assert not value[1:].any()


def test_sets_are_those_of_hapke():
    assert parameters_of("hapke", "sato_mare_643") == HAPKE_SETS["sato_mare_643"]
    assert parameters_of("hapke_chrono", "sato_mare_643").hapke.w == HAPKE_SETS["sato_mare_643"].w
    with pytest.raises(RenderError, match="basalt"):
        parameters_of("hapke", "basalt")
    with pytest.raises(RenderError, match="lambert has no parameter sets"):
        parameters_of("lambert", "chrono_lunar")


def test_a_diagram_of_every_set_is_drawn(tmp_path):
    draw_brdf(tmp_path / "brdf.png", HAPKE_SETS, 30)
    assert png.read(tmp_path / "brdf.png").std() > 5
