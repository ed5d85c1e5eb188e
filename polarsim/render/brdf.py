"""Reflectance models in NumPy, f_r = L_out / (J cos i) in 1/sr: the reference implementation.

The arguments of `reflectance` are unit vectors (n, 3) along the normal, to the lamp and to the viewer; the result (n,)
is 0 if lamp or viewer is below the surface. The computation uses the precision of the vectors and is accurate in
float32 (no cancellation near opposition or in the principal plane). Internally vectors are (3, n), because NumPy is
five times faster on contiguous rows.
"""

from __future__ import annotations

import math

import numpy as np

from polarsim.render.parameters import (
    HapkeChronoParameters,
    HapkeParameters,
    LambertParameters,
    LunarLambertParameters,
    Parameters,
    PrincipledChronoParameters,
    PrincipledParameters,
)

GRAZING = 1e-6  # cosines below this are treated as 0: the models are undefined if both cosines are 0
_TINY = 1e-12
SMOOTH = 1e-6  # radians of roughness below which the smooth form is used


def reflectance(parameters: Parameters, normal: np.ndarray, to_lamp: np.ndarray, to_viewer: np.ndarray) -> np.ndarray:
    """Return f_r (n,) of the model with the given parameters for unit vectors (n, 3)."""
    model = {
        HapkeParameters: hapke,
        PrincipledParameters: principled,
        LambertParameters: lambert,
        LunarLambertParameters: lunar_lambert,
        HapkeChronoParameters: hapke_chrono,
        PrincipledChronoParameters: principled_chrono,
    }[type(parameters)]
    n, lamp, viewer = (np.ascontiguousarray(vectors.T) for vectors in (normal, to_lamp, to_viewer))
    cos_i, cos_e = _dot(n, lamp), _dot(n, viewer)
    with np.errstate(all="ignore"):  # values of surfaces that face away are discarded
        f_r = model(parameters, n, lamp, viewer, cos_i, cos_e)  # type: ignore[operator]
    return np.asarray(np.where((cos_i > GRAZING) & (cos_e > GRAZING), f_r, f_r.dtype.type(0)))


def lambert(parameters, normal, to_lamp, to_viewer, cos_i, cos_e):  # type: ignore[no-untyped-def] # noqa: ARG001
    """Albedo / pi."""
    return np.full_like(cos_i, parameters.albedo / np.pi)


def lunar_lambert(parameters, normal, to_lamp, to_viewer, cos_i, cos_e):  # type: ignore[no-untyped-def] # noqa: ARG001
    """McEwen, Icarus 92 (1991) 298; coefficients as in USGS ISIS (`LunarLambertMcEwen`)."""
    if parameters.weight == "mcewen":
        g = np.degrees(2 * np.arctan(_tan_half_phase(to_lamp, to_viewer)))
        share = np.clip(1 + g * (-0.019 + g * (2.42e-4 - 1.46e-6 * g)), 0, 1)
    else:
        share = parameters.weight
    return parameters.albedo / np.pi * (2 * share / (cos_i + cos_e) + 1 - share)


def principled(parameters, normal, to_lamp, to_viewer, cos_i, cos_e):  # type: ignore[no-untyped-def]
    """Burley, SIGGRAPH 2012 course; separable GGX lobe of Walter et al., EGSR 2007; exact Fresnel."""
    base, rough, metallic = parameters.base_color, parameters.roughness, parameters.metallic
    alpha2 = parameters.alpha2
    half = to_lamp + to_viewer
    length2 = _dot(half, half)
    cos_d = 0.5 * np.sqrt(length2)
    grazing_i, grazing_e = _fifth(1 - cos_i), _fifth(1 - cos_e)
    fd90 = 0.5 + 2 * rough * cos_d * cos_d
    diffuse = (1 - metallic) * base / np.pi * (1 + (fd90 - 1) * grazing_i) * (1 + (fd90 - 1) * grazing_e)
    in_plane = half - (cos_i + cos_e) * normal  # |in_plane|^2 is sin^2 of the half angle, free of cancellation
    cos2_h, sin2_h = (cos_i + cos_e) ** 2 / length2, _dot(in_plane, in_plane) / length2
    density = alpha2 / (np.pi * (cos2_h * alpha2 + sin2_h) ** 2)
    fresnel = (1 - metallic) * _dielectric(cos_d, parameters.eta) + metallic * (base + (1 - base) * _fifth(1 - cos_d))
    # G1(c) / c = 2 / (c + sqrt(c^2 + alpha^2 (1 - c^2))): finite at grazing angles
    masking_i = 2 / (cos_i + np.sqrt(cos_i**2 + alpha2 * (1 - cos_i**2)))
    masking_e = 2 / (cos_e + np.sqrt(cos_e**2 + alpha2 * (1 - cos_e**2)))
    return diffuse + fresnel * density * masking_i * masking_e / 4


def principled_chrono(parameters, normal, to_lamp, to_viewer, cos_i, cos_e):  # type: ignore[no-untyped-def] # noqa: ARG001
    """Chrono::Sensor 2025, `material_shaders.cu`, over pi: Lambert minus specular share; GGX with Hammon's masking."""
    p = parameters
    half = to_lamp + to_viewer
    length2 = _dot(half, half)
    cos2_h, cos_d = (cos_i + cos_e) ** 2 / length2, 0.5 * np.sqrt(length2)
    density = p.roughness**2 / (cos2_h * (p.roughness**2 - 1) + 1) ** 2
    masking = 0.5 / ((1 - p.roughness) * 2 * cos_i * cos_e + p.roughness * (cos_i + cos_e))
    mirrored = p.mirrored + (1 - p.mirrored) * _fifth(1 - cos_d)
    return ((1 - mirrored) * p.k_d + mirrored * density * masking) / np.pi


def _fifth(x: np.ndarray) -> np.ndarray:
    """Return x^5, five times faster than NumPy's power."""
    return (x * x) * (x * x) * x


def _dielectric(cos_d: np.ndarray, eta: float) -> np.ndarray:
    """Unpolarised Fresnel reflectance."""
    inside = np.sqrt(1 - (1 - cos_d * cos_d) / (eta * eta))
    across = (cos_d - eta * inside) / (cos_d + eta * inside)
    along = (eta * cos_d - inside) / (eta * cos_d + inside)
    return (across**2 + along**2) / 2


def hapke_chrono(parameters, normal, to_lamp, to_viewer, cos_i, cos_e):  # type: ignore[no-untyped-def]
    """Chrono::Sensor 2025, `material_shaders.cu`: not reciprocal, discontinuous where i = g."""
    by_phase = cos_i >= _dot(to_lamp, to_viewer)
    return parameters.k_d * hapke(parameters.hapke, normal, to_lamp, to_viewer, cos_i, cos_e, by_phase)


def hapke(parameters, normal, to_lamp, to_viewer, cos_i, cos_e, lamp_steeper=None):  # type: ignore[no-untyped-def]
    """Hapke 2012 (book, 2nd edition), in the form of Sato et al., JGR Planets 119 (2014) 1775, appendix A.

    `lamp_steeper` (n,): whether the lamp ray is treated as the steeper of the two rays; default: i <= e.
    """
    p = parameters
    lamp_steeper = cos_i >= cos_e if lamp_steeper is None else lamp_steeper  # i <= e
    porosity = p.porosity
    tan_half = _tan_half_phase(to_lamp, to_viewer)
    cos_g = _dot(to_lamp, to_viewer)
    theta_bar = math.radians(p.theta_bar_deg)
    if theta_bar > SMOOTH:
        eff_i, eff_e, shading = _roughness(math.tan(theta_bar), normal, to_lamp, to_viewer, cos_i, cos_e, lamp_steeper)
    else:
        eff_i, eff_e, shading = cos_i, cos_e, 1 / cos_i
    single = _phase(cos_g, p.b, p.c)
    if p.b_s0:
        single = single * (1 + p.b_s0 / (1 + tan_half / p.h_s))
    multiple = _chandrasekhar(eff_i / porosity, p) * _chandrasekhar(eff_e / porosity, p) - 1
    value = porosity * p.w / (4 * np.pi) * eff_i / (eff_i + eff_e) * (single + multiple) * shading
    if p.b_c0:
        value = value * (1 + p.b_c0 * _coherent(tan_half / p.h_c))
    return value


def _phase(cos_g: np.ndarray, b: float, c: float) -> np.ndarray:
    """Two Henyey-Greenstein lobes; c > 0 scatters backwards."""
    back, forward = 1 + b * b - 2 * b * cos_g, 1 + b * b + 2 * b * cos_g
    return (1 - b * b) / 2 * ((1 + c) / (back * np.sqrt(back)) + (1 - c) / (forward * np.sqrt(forward)))


def _chandrasekhar(x: np.ndarray, p: HapkeParameters) -> np.ndarray:
    """Hapke's approximation of 2002 of the H function."""
    gamma = math.sqrt(1 - p.w)
    r0 = (1 - gamma) / (1 + gamma)
    x = np.maximum(x, x.dtype.type(_TINY))
    return 1 / (1 - p.w * x * (r0 + (1 - 2 * r0 * x) / 2 * np.log((1 + x) / x)))


def _coherent(x: np.ndarray) -> np.ndarray:
    """Shape of the coherent-backscatter peak, 1 at x = 0."""
    safe = np.maximum(x, x.dtype.type(1e-30))
    return (1 - np.expm1(-safe) / safe) / (2 * (1 + x) ** 2)


def _roughness(tan_bar, normal, to_lamp, to_viewer, cos_i, cos_e, lamp_steeper):  # type: ignore[no-untyped-def]
    """Effective cosines and shading S / cos i (Hapke, Icarus 59 (1984) 41), for tan(theta-bar) > 0.

    The two published branches are the same formula in terms of the steeper and the flatter ray.
    """
    lamp_flat, view_flat = to_lamp - cos_i * normal, to_viewer - cos_e * normal
    sin_i, sin_e = np.sqrt(_dot(lamp_flat, lamp_flat)), np.sqrt(_dot(view_flat, view_flat))
    psi, cos_psi, tan_half_psi = _azimuth(lamp_flat, view_flat, normal)
    sin2_half = (1 - cos_psi) / 2
    chi = 1 / math.sqrt(1 + math.pi * tan_bar**2)
    e1_i, e2_i = _slopes(tan_bar, cos_i, sin_i)
    e1_e, e2_e = _slopes(tan_bar, cos_e, sin_e)
    eta_i = chi * (cos_i + sin_i * tan_bar * e2_i / (2 - e1_i))
    eta_e = chi * (cos_e + sin_e * tan_bar * e2_e / (2 - e1_e))
    e1_steep, e1_flat = np.where(lamp_steeper, e1_i, e1_e), np.where(lamp_steeper, e1_e, e1_i)
    e2_steep, e2_flat = np.where(lamp_steeper, e2_i, e2_e), np.where(lamp_steeper, e2_e, e2_i)
    both = 2 - e1_flat - psi / np.pi * e1_steep
    tilt_steep = tan_bar * (cos_psi * e2_flat + sin2_half * e2_steep) / both
    tilt_flat = tan_bar * (e2_flat - sin2_half * e2_steep) / both
    eff_i = chi * (cos_i + sin_i * np.where(lamp_steeper, tilt_steep, tilt_flat))
    eff_e = chi * (cos_e + sin_e * np.where(lamp_steeper, tilt_flat, tilt_steep))
    hidden = np.exp(-2 * tan_half_psi)
    steep = np.where(lamp_steeper, cos_i / eta_i, cos_e / eta_e)
    return eff_i, eff_e, eff_e / eta_e / eta_i * chi / (1 - hidden + hidden * chi * steep)


def _slopes(tan_bar: float, cos_x: np.ndarray, sin_x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """E1 and E2 of Hapke 1984."""
    cot_cot = cos_x / np.maximum(sin_x, sin_x.dtype.type(_TINY)) / tan_bar
    return np.exp(-2 / np.pi * cot_cot), np.exp(-1 / np.pi * cot_cot * cot_cot)


def _azimuth(lamp_flat, view_flat, normal):  # type: ignore[no-untyped-def]
    """Return psi, cos psi, tan(psi / 2) between two vectors in the surface plane; psi = 0 if a vector vanishes."""
    along = _dot(lamp_flat, view_flat)
    (nx, ny, nz), (lx, ly, lz), (vx, vy, vz) = normal, lamp_flat, view_flat
    across = np.abs(nx * (ly * vz - lz * vy) + ny * (lz * vx - lx * vz) + nz * (lx * vy - ly * vx))
    size = np.sqrt(along * along + across * across)
    defined = size > 1e-20
    cos_psi = np.where(defined, along / size, along.dtype.type(1))
    # Two equivalent forms of tan(psi / 2), each where it has no cancellation.
    tan_half = np.where(along >= 0, across / (size + along), (size - along) / np.maximum(across, size * 1e-7))
    tan_half = np.where(defined, tan_half, along.dtype.type(0))
    return np.where(defined, np.arctan2(across, along), along.dtype.type(0)), cos_psi, tan_half


def _tan_half_phase(to_lamp: np.ndarray, to_viewer: np.ndarray) -> np.ndarray:
    """tan(g / 2) = |L - V| / |L + V|, accurate near opposition."""
    difference, total = to_lamp - to_viewer, to_lamp + to_viewer
    return np.sqrt(_dot(difference, difference) / np.maximum(_dot(total, total), difference.dtype.type(_TINY)))


def _dot(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return the scalar products (n,) of vectors (3, n)."""
    return first[0] * second[0] + first[1] * second[1] + first[2] * second[2]
