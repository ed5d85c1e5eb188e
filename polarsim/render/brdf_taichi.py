"""`brdf.reflectance` as Taichi kernels in float32, for GPUs. Tests compare the kernels with the reference.

The module is imported only if the configuration selects Taichi, because the import requires Taichi.
"""
# mypy: ignore-errors
# No `from __future__ import annotations` here: Taichi reads the kernels' annotations as objects.

import math

import numpy as np

from polarsim.geometry.taichi_device import on_taichi_thread, ti
from polarsim.geometry.taichi_walk import VALUES, VECTORS
from polarsim.render.brdf import GRAZING
from polarsim.render.parameters import (
    HapkeChronoParameters,
    HapkeParameters,
    LambertParameters,
    Parameters,
    PrincipledChronoParameters,
    PrincipledParameters,
)

_PI = math.pi


@on_taichi_thread
def reflectance(parameters: Parameters, normal: np.ndarray, to_lamp: np.ndarray, to_viewer: np.ndarray) -> np.ndarray:
    """Return `brdf.reflectance` in float32; call `taichi_device.start` first."""
    vectors = [np.ascontiguousarray(v, np.float32) for v in (normal, to_lamp, to_viewer)]
    value = np.zeros(len(normal), np.float32)
    if not len(normal):
        return value
    evaluate_brdf(parameters, *vectors, value)
    return value


def evaluate_brdf(parameters: Parameters, normal, to_lamp, to_viewer, value) -> None:
    """Write f_r into `value` (n,), a NumPy or device array; elements of unlit points are unchanged."""
    vectors = normal, to_lamp, to_viewer
    if isinstance(parameters, HapkeParameters):
        _hapke(*vectors, value, *_hapke_numbers(parameters), 0, 1.0)
    elif isinstance(parameters, HapkeChronoParameters):
        _hapke(*vectors, value, *_hapke_numbers(parameters.hapke), 1, parameters.k_d)
    elif isinstance(parameters, PrincipledChronoParameters):
        p = parameters
        _principled_chrono(*vectors, value, p.roughness, p.k_d, p.mirrored)
    elif isinstance(parameters, PrincipledParameters):
        p = parameters
        _principled(*vectors, value, p.base_color, p.roughness, p.metallic, p.alpha2, p.eta)
    elif isinstance(parameters, LambertParameters):
        _lunar_lambert(*vectors, value, parameters.albedo, 0.0)
    else:
        weight = -1.0 if parameters.weight == "mcewen" else float(parameters.weight)
        _lunar_lambert(*vectors, value, parameters.albedo, weight)


def _hapke_numbers(p: HapkeParameters) -> tuple[float, ...]:
    tan_bar = math.tan(math.radians(p.theta_bar_deg))
    return p.w, p.b, p.c, p.b_s0, p.h_s, p.b_c0, p.h_c, tan_bar, p.porosity


@ti.func
def _tan_half_phase(to_lamp, to_viewer):
    apart, together = to_lamp - to_viewer, to_lamp + to_viewer
    return ti.sqrt(apart.dot(apart) / ti.max(together.dot(together), 1e-12))


@ti.kernel
def _lunar_lambert(normal: VECTORS, lamp: VECTORS, viewer: VECTORS, out: VALUES, albedo: ti.f32, weight: ti.f32):
    for n in out:
        cos_i, cos_e = normal[n].dot(lamp[n]), normal[n].dot(viewer[n])
        if cos_i > GRAZING and cos_e > GRAZING:
            share = weight
            if weight < 0:
                g = 2 * ti.atan2(_tan_half_phase(lamp[n], viewer[n]), 1.0) * (180 / _PI)
                share = ti.math.clamp(1 + g * (-0.019 + g * (2.42e-4 - 1.46e-6 * g)), 0.0, 1.0)
            out[n] = albedo / _PI * (2 * share / (cos_i + cos_e) + 1 - share)


@ti.func
def _dielectric(cos_d, eta):
    inside = ti.sqrt(1 - (1 - cos_d * cos_d) / (eta * eta))
    across = (cos_d - eta * inside) / (cos_d + eta * inside)
    along = (eta * cos_d - inside) / (eta * cos_d + inside)
    return (across * across + along * along) / 2


@ti.func
def _masking(cosine, alpha2):
    return 2 / (cosine + ti.sqrt(cosine * cosine + alpha2 * (1 - cosine * cosine)))


@ti.kernel
def _principled(
    normal: VECTORS, lamp: VECTORS, viewer: VECTORS, out: VALUES,
    base: ti.f32, rough: ti.f32, metallic: ti.f32, alpha2: ti.f32, eta: ti.f32,
):  # fmt: skip
    for n in out:
        cos_i, cos_e = normal[n].dot(lamp[n]), normal[n].dot(viewer[n])
        if cos_i > GRAZING and cos_e > GRAZING:
            half = lamp[n] + viewer[n]
            length2 = half.dot(half)
            cos_d = 0.5 * ti.sqrt(length2)
            fd90 = 0.5 + 2 * rough * cos_d * cos_d
            diffuse = (1 - metallic) * base / _PI
            diffuse *= (1 + (fd90 - 1) * (1 - cos_i) ** 5) * (1 + (fd90 - 1) * (1 - cos_e) ** 5)
            in_plane = half - (cos_i + cos_e) * normal[n]
            spread = (cos_i + cos_e) ** 2 / length2 * alpha2 + in_plane.dot(in_plane) / length2
            density = alpha2 / (_PI * spread * spread)
            fresnel = (1 - metallic) * _dielectric(cos_d, eta)
            fresnel += metallic * (base + (1 - base) * (1 - cos_d) ** 5)
            out[n] = diffuse + fresnel * density * _masking(cos_i, alpha2) * _masking(cos_e, alpha2) / 4


@ti.kernel
def _principled_chrono(
    normal: VECTORS, lamp: VECTORS, viewer: VECTORS, out: VALUES,
    rough: ti.f32, albedo: ti.f32, mirrored: ti.f32,
):  # fmt: skip
    for n in out:
        cos_i, cos_e = normal[n].dot(lamp[n]), normal[n].dot(viewer[n])
        if cos_i > GRAZING and cos_e > GRAZING:
            half = lamp[n] + viewer[n]
            length2 = half.dot(half)
            spread = (cos_i + cos_e) ** 2 / length2 * (rough * rough - 1) + 1
            masking = 0.5 / ((1 - rough) * 2 * cos_i * cos_e + rough * (cos_i + cos_e))
            share = mirrored + (1 - mirrored) * (1 - 0.5 * ti.sqrt(length2)) ** 5
            out[n] = ((1 - share) * albedo + share * rough * rough / (spread * spread) * masking) / _PI


@ti.func
def _phase(cos_g, b, c):
    back, forward = 1 + b * b - 2 * b * cos_g, 1 + b * b + 2 * b * cos_g
    return (1 - b * b) / 2 * ((1 + c) / (back * ti.sqrt(back)) + (1 - c) / (forward * ti.sqrt(forward)))


@ti.func
def _log1p(x):
    """log(1 + x) for x > 0, accurate at small x (Kahan)."""
    total = 1 + x
    rest = total - 1
    value = x
    if rest > 0:
        value = ti.log(total) * x / rest
    return value


@ti.func
def _chandrasekhar(x, w):
    gamma = ti.sqrt(1 - w)
    r0 = (1 - gamma) / (1 + gamma)
    y = ti.max(x, 1e-12)
    return 1 / (1 - w * y * (r0 + (1 - 2 * r0 * y) / 2 * _log1p(1 / y)))


@ti.func
def _coherent(x):
    share = 1 - x / 2 + x * x / 6 - x * x * x / 24  # (1 - exp(-x)) / x near 0, where the difference cancels
    if x > 0.1:
        share = (1 - ti.exp(-x)) / x
    return (1 + share) / (2 * (1 + x) ** 2)


@ti.func
def _slopes(tan_bar, cos_x, sin_x):
    cot_cot = cos_x / ti.max(sin_x, 1e-12) / tan_bar
    return ti.math.vec2(ti.exp(-2 / _PI * cot_cot), ti.exp(-1 / _PI * cot_cot * cot_cot))


@ti.func
def _azimuth(along, across):
    """Return psi, cos psi, tan(psi / 2), with psi = 0 if psi is undefined."""
    size = ti.sqrt(along * along + across * across)
    angles = ti.math.vec3(0.0, 1.0, 0.0)
    if size > 1e-20:
        tan_half = (size - along) / ti.max(across, size * 1e-7)
        if along >= 0:
            tan_half = across / (size + along)
        angles = ti.math.vec3(ti.atan2(across, along), along / size, tan_half)
    return angles


@ti.func
def _roughness(tan_bar, normal, lamp, viewer, cos_i, cos_e, viewer_steeper):
    """Effective cosines, and S / cos i."""
    lamp_flat, view_flat = lamp - cos_i * normal, viewer - cos_e * normal
    psi = _azimuth(lamp_flat.dot(view_flat), ti.abs(normal.dot(lamp_flat.cross(view_flat))))
    sin_i, sin_e = lamp_flat.norm(), view_flat.norm()
    sin2_half = (1 - psi[1]) / 2
    chi = 1 / ti.sqrt(1 + _PI * tan_bar * tan_bar)
    slopes_i, slopes_e = _slopes(tan_bar, cos_i, sin_i), _slopes(tan_bar, cos_e, sin_e)
    eta_i = chi * (cos_i + sin_i * tan_bar * slopes_i[1] / (2 - slopes_i[0]))
    eta_e = chi * (cos_e + sin_e * tan_bar * slopes_e[1] / (2 - slopes_e[0]))
    steep, flat, ratio = slopes_i, slopes_e, cos_i / eta_i
    if viewer_steeper:
        steep, flat, ratio = slopes_e, slopes_i, cos_e / eta_e
    both = 2 - flat[0] - psi[0] / _PI * steep[0]
    tilt_i = tan_bar * (psi[1] * flat[1] + sin2_half * steep[1]) / both
    tilt_e = tan_bar * (flat[1] - sin2_half * steep[1]) / both
    if viewer_steeper:
        tilt_i, tilt_e = tilt_e, tilt_i
    eff_i, eff_e = chi * (cos_i + sin_i * tilt_i), chi * (cos_e + sin_e * tilt_e)
    hidden = ti.exp(-2 * psi[2])
    return ti.math.vec3(eff_i, eff_e, eff_e / eta_e / eta_i * chi / (1 - hidden + hidden * chi * ratio))


@ti.kernel
def _hapke(
    normal: VECTORS, lamp: VECTORS, viewer: VECTORS, out: VALUES,
    w: ti.f32, b: ti.f32, c: ti.f32, b_s0: ti.f32, h_s: ti.f32, b_c0: ti.f32, h_c: ti.f32,
    tan_bar: ti.f32, porosity: ti.f32, by_phase: ti.i32, factor: ti.f32,
):  # fmt: skip
    for n in out:
        cos_i, cos_e = normal[n].dot(lamp[n]), normal[n].dot(viewer[n])
        if cos_i > GRAZING and cos_e > GRAZING:
            rough = ti.math.vec3(cos_i, cos_e, 1 / cos_i)
            if tan_bar > 1e-6:
                viewer_steeper = cos_i < cos_e
                if by_phase:
                    viewer_steeper = cos_i < lamp[n].dot(viewer[n])
                rough = _roughness(tan_bar, normal[n], lamp[n], viewer[n], cos_i, cos_e, viewer_steeper)
            tan_half = _tan_half_phase(lamp[n], viewer[n])
            single = _phase(lamp[n].dot(viewer[n]), b, c) * (1 + b_s0 / (1 + tan_half / h_s))
            multiple = _chandrasekhar(rough[0] / porosity, w)
            multiple = multiple * _chandrasekhar(rough[1] / porosity, w) - 1
            value = porosity * w / (4 * _PI) * rough[0] / (rough[0] + rough[1]) * (single + multiple) * rough[2]
            out[n] = factor * value * (1 + b_c0 * _coherent(tan_half / h_c))
