import numpy as np
import pytest

from polarsim.errors import RenderError
from polarsim.formats import png
from polarsim.formats.tables import read_csv
from polarsim.render.goniometer import (
    goniometer_directions,
    in_plane_of_incidence,
    opposite_the_lamp,
    parameters_of,
    phase_deg,
    reflectance_at,
    write_reflectance,
)
from polarsim.render.options import MODELS, RenderOptions
from polarsim.render.parameters import HAPKE_SETS
from polarsim.report.figures.brdf import draw_brdf


def test_phase_angles_are_differences_and_sums_in_the_plane_of_incidence_and_angles_between_vectors_elsewhere():
    np.testing.assert_allclose(phase_deg([30, 30, 30, 89], [20, 20, 30, 89], [0, 180, 0, 180]), [10, 50, 0, 178])
    normal, to_lamp, to_viewer = goniometer_directions(30, 70, 120)
    np.testing.assert_allclose(np.degrees(np.arccos([(normal * v).sum() for v in (to_lamp, to_viewer)])), [30, 70])
    np.testing.assert_allclose(phase_deg(30, 70, 120), np.degrees(np.arccos((to_lamp * to_viewer).sum())))


@pytest.mark.parametrize("model", MODELS)
def test_every_model_has_a_reflectance_that_ends_at_the_horizon(model):
    value = reflectance_at(parameters_of(model), np.array([30, 30, 90]), np.array([30, 90, 30]), np.zeros(3))
    assert value[0] > 0
    assert not value[1:].any()


def test_parameter_sets_exist_for_hapke_only():
    assert parameters_of("hapke", "sato_mare_643") == HAPKE_SETS["sato_mare_643"]
    assert parameters_of("hapke_chrono", "sato_mare_643").hapke.w == HAPKE_SETS["sato_mare_643"].w
    with pytest.raises(RenderError):
        parameters_of("hapke", "basalt")
    with pytest.raises(RenderError):
        parameters_of("lambert", "chrono_lunar")


def test_curves_are_reflectance_factors_over_the_phase_angle():
    soil = HAPKE_SETS["chrono_lunar"]
    phase, factor = in_plane_of_incidence(soil, 30)
    assert (np.diff(phase) < 0).all()
    assert phase[np.argmax(factor)] == pytest.approx(0, abs=1e-6)  # the opposition surge
    phase, factor = opposite_the_lamp(soil)
    assert (phase[0], phase[-1]) == (0, pytest.approx(178))
    assert factor[0] == pytest.approx(np.pi * reflectance_at(soil, 0, 0, 0)[0])


def test_a_diagram_is_drawn(tmp_path):
    draw_brdf(tmp_path / "brdf.png", {"one": {"soil": opposite_the_lamp(HAPKE_SETS["chrono_lunar"])}})
    assert png.read_png(tmp_path / "brdf.png").std() > 5


def test_the_curves_of_a_run_use_its_parameters(tmp_path):
    options = RenderOptions(materials={"default": {"lambert": {"albedo": 0.35}}})
    write_reflectance(curves=tmp_path / "curves.csv", options=options)
    table = read_csv(tmp_path / "curves.csv")
    assert set(table["model"]) == set(MODELS)
    matt = table[(table["model"] == "lambert") & (table["pi_f_r"] > 0)]
    np.testing.assert_allclose(matt["pi_f_r"], 0.35, rtol=1e-6)
    across = table[table["panel"].str.contains("opposite")]
    assert across["phase_deg"].min() == 0
    assert across["phase_deg"].max() > 177
