from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from polarsim.render import brdf, brdf_numba, goniometer
from polarsim.render.parameters import (
    HAPKE_SETS,
    HapkeChronoParameters,
    HapkeParameters,
    LambertParameters,
    LunarLambertParameters,
    PrincipledChronoParameters,
    PrincipledParameters,
)

PINNED = pd.read_csv(Path(__file__).parent.parent / "data" / "brdf_pinned.csv")
RECIPROCAL = [
    *HAPKE_SETS.values(),
    HapkeParameters(w=0.9, b=0.3, c=-0.4, b_s0=0.8, h_s=0.06, b_c0=0.5, h_c=0.02, theta_bar_deg=15),
    PrincipledParameters(),
    PrincipledParameters(base_color=0.6, roughness=0.4, metallic=0.5),
    LambertParameters(),
    LunarLambertParameters(),
    PrincipledChronoParameters(),
    PrincipledChronoParameters(k_s=0.5, roughness=0.4),
]
SAMPLES = [*RECIPROCAL, HapkeChronoParameters()]


def parameters_of(row):
    """Return the parameters of a row of the pinned table; K and eta are recomputed."""
    if row.model.startswith("hapke"):
        soil = HapkeParameters(
            w=row.w, b=row.b, c=row.c, b_s0=row.B_S0, h_s=row.h_S, b_c0=row.B_C0, h_c=row.h_C,
            theta_bar_deg=row.theta_bar_deg, filling=row.phi,
        )  # fmt: skip
        return soil if row.model == "hapke" else HapkeChronoParameters(soil=row.set, k_d=row.Kd)
    if row.model == "principled_chrono":
        return PrincipledChronoParameters(k_d=row.Kd, k_s=row.Ks, roughness=row.roughness)
    if row.model == "principled":
        return PrincipledParameters(
            base_color=row.base_color, roughness=row.roughness, specular=row.specular, metallic=row.metallic
        )
    if row.model == "lambert":
        return LambertParameters(albedo=row.albedo)
    return LunarLambertParameters(albedo=row.albedo, weight="mcewen" if row.L == "mcewen" else float(row.L))


def pinned_value(row):
    """Return f_r of a row; the value of Chrono's Hapke does not include the diffuse colour."""
    return row.shader_factor if row.model == "hapke_chrono" else row.f_r


def directions(incidence_deg, emergence_deg, azimuth_deg, dtype=float):
    """Return normal, to_lamp and to_viewer for angles (n,)."""
    return [v.astype(dtype) for v in goniometer.goniometer_directions(incidence_deg, emergence_deg, azimuth_deg)]


def random_directions(rng, n, widest_deg=89.9):
    low = np.cos(np.radians(widest_deg))
    i, e = np.degrees(np.arccos(rng.uniform(low, 1, (2, n))))
    rotation = np.linalg.qr(rng.normal(size=(3, 3)))[0]  # no axis is special
    return [vectors @ rotation.T for vectors in directions(i, e, rng.uniform(0, 180, n))]


def off_the_step(normal, to_lamp, to_viewer):
    """Return which directions (n,) are not at i = g, where Chrono's Hapke is discontinuous."""
    return np.abs((normal * to_lamp).sum(axis=1) - (to_viewer * to_lamp).sum(axis=1)) > 1e-5


@pytest.fixture(scope="module", params=["numpy", "numba", "taichi"])
def engine(request):
    if request.param == "taichi":
        from polarsim.geometry import taichi_device
        from polarsim.render import brdf_taichi

        taichi_device.start(threads=1)
        return brdf_taichi
    return brdf if request.param == "numpy" else brdf_numba


def test_reflectance_equals_all_pinned_values(engine):
    assert len(PINNED) == 175
    for _, row in PINNED.iterrows():
        vectors = directions(row.incidence_deg, row.emergence_deg, row.azimuth_deg)
        expected = pytest.approx(pinned_value(row), rel=1e-9 if engine is brdf else 1e-3)
        assert engine.reflectance(parameters_of(row), *vectors)[0] == expected, (row.model, row.set, tuple(row[-6:-2]))


@pytest.mark.parametrize("parameters", RECIPROCAL)
def test_reflectance_is_reciprocal(parameters, rng):
    normal, to_lamp, to_viewer = random_directions(rng, 5000)
    forth = brdf.reflectance(parameters, normal, to_lamp, to_viewer)
    back = brdf.reflectance(parameters, normal, to_viewer, to_lamp)
    np.testing.assert_allclose(back, forth, rtol=1e-9)
    assert (forth > 0).all()


def test_chronos_hapke_differs_only_where_the_branch_is_wrong(rng):
    """The branch is wrong for 38 % of all directions; the error exceeds 1 % for 27 % of all directions."""
    vectors = random_directions(rng, 20_000)
    slipped = brdf.reflectance(HapkeChronoParameters(k_d=1), *vectors) / brdf.reflectance(
        HAPKE_SETS["chrono_lunar"], *vectors
    )
    assert 0.25 < (np.abs(slipped - 1) > 0.01).mean() < 0.29
    assert 0.55 < (np.abs(slipped - 1) < 1e-9).mean() < 0.75
    assert (slipped > 0).all()


@pytest.mark.parametrize("parameters", SAMPLES)
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_singular_directions_have_finite_values_that_are_zero_for_surfaces_that_face_away(engine, parameters, dtype):
    angles = np.array(
        [
            (0, 0, 0), (0, 40, 0), (40, 0, 90), (1e-4, 1e-4, 0), (30, 30, 0), (85, 85, 0), (30, 30, 180),
            (89, 89, 180), (89, 89, 0), (89.9, 10, 90), (10, 89.9, 180), (60, 60, 1e-5), (45, 45, 179.99999),
            (90, 45, 0), (45, 90, 0), (90, 90, 180), (120, 30, 0), (30, 120, 180), (120, 120, 0),
        ]
    )  # fmt: skip
    value = engine.reflectance(parameters, *directions(*angles.T, dtype=dtype))
    assert np.isfinite(value).all()
    np.testing.assert_array_equal(value > 0, (angles[:, :2] < 90).all(axis=1))
    assert (value >= 0).all()


@pytest.mark.parametrize("parameters", SAMPLES)
def test_engines_agree_in_float32_with_the_reference_in_double(engine, parameters, rng):
    for widest_deg, tolerance in ((88, 2e-5), (89.9, 1e-3)):
        vectors = random_directions(rng, 20_000, widest_deg)
        vectors = [v[off_the_step(*vectors)].astype(np.float32) for v in vectors]
        expected = brdf.reflectance(parameters, *(v.astype(float) for v in vectors))
        found = engine.reflectance(parameters, *vectors)
        assert found.dtype == np.float32
        np.testing.assert_allclose(found, expected, rtol=tolerance)


@pytest.mark.parametrize(
    (
        "parameters",
        "expected",
    ),  # directional-hemispherical reflectance at i = 0, 30, 60: Gauss quadrature by an independent program
    [
        (HAPKE_SETS["chrono_lunar"], (0.1221, 0.1268, 0.1318)),
        (HAPKE_SETS["sato_mare_643"], (0.0629, 0.0657, 0.0693)),
        (PrincipledParameters(base_color=0.5, roughness=0.5), (0.5400, 0.5418, 0.5708)),
        (LambertParameters(albedo=0.3), (0.3, 0.3, 0.3)),
        (LunarLambertParameters(albedo=0.12), (0.1311, 0.1362, 0.1519)),
    ],
)
def test_light_scattered_into_the_hemisphere_matches_quadrature(parameters, expected):
    cos_e = (np.arange(400) + 0.5) / 400
    psi = np.degrees((np.arange(360) + 0.5) / 360 * np.pi)
    e, psi = (a.ravel() for a in np.meshgrid(np.degrees(np.arccos(cos_e)), psi))
    for incidence_deg, share in zip((0, 30, 60), expected, strict=True):
        value = brdf.reflectance(parameters, *directions(np.full_like(e, incidence_deg), e, psi))
        assert 2 * np.pi * (value * np.cos(np.radians(e))).mean() == pytest.approx(share, rel=2e-3)


@pytest.mark.parametrize("parameters", [one for one in SAMPLES if not hasattr(one, "w") and not hasattr(one, "soil")])
def test_numba_equals_the_reference_for_models_without_functions(parameters, rng):
    vectors = [v.astype(np.float32) for v in random_directions(rng, 20_000, 89.9)]
    expected = brdf.reflectance(parameters, *vectors)
    np.testing.assert_array_equal(brdf_numba.reflectance(parameters, *vectors), expected)
