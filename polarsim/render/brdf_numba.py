"""`brdf.reflectance` in float32, compiled by Numba into vectorised loops without intermediate arrays.

1.8 million points take 18 ms (Hapke) and 4 ms (principled) on one thread with AVX-512; the reference takes 159 and
56 ms. Models without functions other than square roots return the float32 values of the reference to the last bit.
Exponentials and logarithms are polynomials: Cephes' `expf` and `logf` (Moshier, Methods and Programs for Mathematical
Functions, 1989), accurate to 2e-7, seven times as fast as NumPy in a compiled loop and, unlike NumPy, equal on every
processor.
"""

from __future__ import annotations

import math

import numpy as np
from numba.core import types
from numba.extending import intrinsic

from polarsim.kernels import njit
from polarsim.render import brdf
from polarsim.render.parameters import HapkeChronoParameters, HapkeParameters, Parameters, PrincipledParameters

_f = np.float32  # integers and Python floats would promote a float32 expression to float64
_0, _HALF, _1, _2, _4, _PI = _f(0), _f(0.5), _f(1), _f(2), _f(4), _f(np.pi)
_GRAZING, _TINY = _f(brdf.GRAZING), _f(1e-12)
_NO_DIRECTION, _MIN_RATIO = _f(1e-20), _f(1e-7)
_TO_WHOLE = _f(1.5 * 2**23)  # added to a number, it rounds the number to an integer in the last bits
_LOG2_E, _LN2_HIGH, _LN2_LOW = _f(math.log2(math.e)), _f(0.693359375), _f(-2.12194440e-4)
_EXP_RANGE = _f(-87), _f(88)
_EXP = tuple(_f(c) for c in (1.9875691500e-4, 1.3981999507e-3, 8.3334519073e-3, 4.1665795894e-2, 1.6666665459e-1, 0.5))
_SQRT_HALF = _f(0.707106781186547524)
_LOG = tuple(
    _f(c)
    for c in (7.0376836292e-2, -1.1514610310e-1, 1.1676998740e-1, -1.2420140846e-1, 1.4249322787e-1, -1.6668057665e-1,
              2.0000714765e-1, -2.4999993993e-1, 3.3333331174e-1)
)  # fmt: skip
_ARCTAN = tuple(
    _f(c)
    for c in (0.0028662257, -0.0161657367, 0.0429096138, -0.0752896400, 0.1065626393, -0.1420889944, 0.1999355085,
              -0.3333314528, 1)
)  # fmt: skip
_SERIES_BELOW, _SERIES = _f(0.1), tuple(_f(c) for c in (1 / 120, -1 / 24, 1 / 6, -1 / 2, 1))  # of (1 - exp(-x)) / x


def reflectance(parameters: Parameters, normal: np.ndarray, to_lamp: np.ndarray, to_viewer: np.ndarray) -> np.ndarray:
    """Return `brdf.reflectance` in float32; models of a few sums and products call the reference."""
    vectors = [np.require(v, np.float32, ["C", "A", "W"]).reshape(-1) for v in (normal, to_lamp, to_viewer)]
    values = np.empty(len(normal), np.float32)
    if isinstance(parameters, HapkeParameters):
        _hapke(*vectors, *_numbers(parameters), False, _1, values)
    elif isinstance(parameters, HapkeChronoParameters):
        _hapke(*vectors, *_numbers(parameters.hapke), True, _f(parameters.k_d), values)
    elif isinstance(parameters, PrincipledParameters):
        p = parameters
        _principled(
            *vectors,
            _f((1 - p.metallic) * p.base_color / np.pi),
            _f(2 * p.roughness),
            _f(p.alpha2),
            _f(p.eta),
            _f(p.eta * p.eta),
            _f(p.metallic),
            _f(1 - p.metallic),
            _f(p.base_color),
            _f(1 - p.base_color),
            values,
        )
    else:
        return brdf.reflectance(parameters, normal, to_lamp, to_viewer)
    return values


def _numbers(p: HapkeParameters) -> tuple[np.float32, ...]:
    """Return the parameters of `_hapke`."""
    gamma = math.sqrt(1 - p.w)
    tan_bar = math.tan(math.radians(p.theta_bar_deg)) if math.radians(p.theta_bar_deg) > brdf.SMOOTH else 0.0
    numbers = (p.w, p.b, p.c, p.b_s0, p.h_s, p.b_c0, p.h_c, tan_bar, p.porosity, (1 - gamma) / (1 + gamma))
    return tuple(_f(number) for number in numbers)


@intrinsic
def _bits(context, number):  # type: ignore[no-untyped-def] # noqa: ARG001
    """Return the bits of a float32 as an int32."""

    def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def] # noqa: ARG001
        return builder.bitcast(arguments[0], context.get_value_type(types.int32))

    return types.int32(types.float32), generate


@intrinsic
def _from_bits(context, number):  # type: ignore[no-untyped-def] # noqa: ARG001
    """Return the float32 with the bits of an int32."""

    def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def] # noqa: ARG001
        return builder.bitcast(arguments[0], context.get_value_type(types.float32))

    return types.float32(types.int32), generate


_helper = njit(nogil=True, error_model="numpy", inline="always")
_loop = njit(nogil=True, error_model="numpy")


@_helper
def _exp(x):  # type: ignore[no-untyped-def]
    """e^x, with x clamped to the range of float32."""
    x = min(max(x, _EXP_RANGE[0]), _EXP_RANGE[1])
    shifted = x * _LOG2_E + _TO_WHOLE
    power = shifted - _TO_WHOLE
    x = x - power * _LN2_HIGH - power * _LN2_LOW
    value = _EXP[0]
    for factor in _EXP[1:]:
        value = value * x + factor
    value = value * x * x + x + _1
    exponent = np.int32(_bits(shifted) - _bits(_TO_WHOLE) + np.int32(127))
    return value * _from_bits(np.int32(exponent << np.int32(23)))


@_helper
def _log(x):  # type: ignore[no-untyped-def]
    """Natural logarithm of x > 0."""
    bits = _bits(x)
    power = np.float32(np.int32(bits >> np.int32(23)) - np.int32(126))
    x = _from_bits(np.int32((bits & np.int32(0x007FFFFF)) | np.int32(0x3F000000)))
    low = x < _SQRT_HALF
    power = power - (_1 if low else _0)
    x = x + (x if low else _0) - _1
    square = x * x
    value = _LOG[0]
    for factor in _LOG[1:]:
        value = value * x + factor
    value = value * x * square + power * _LN2_LOW - _HALF * square
    return x + value + power * _LN2_HIGH


@_helper
def _angle(across, along):  # type: ignore[no-untyped-def]
    """arctan2 for across >= 0, accurate to 1e-7 (Abramowitz and Stegun, Handbook of Mathematical Functions, 4.4.49)."""
    size = abs(along)
    ratio = min(size, across) / max(size, across)
    square = ratio * ratio
    angle = _ARCTAN[0]
    for factor in _ARCTAN[1:]:
        angle = angle * square + factor
    angle = ratio * angle
    angle = _f(_PI / _2) - angle if across > size else angle
    return _PI - angle if along < _0 else angle


@_helper
def _chandrasekhar(x, w, r0):  # type: ignore[no-untyped-def]
    x = max(x, _TINY)
    return _1 / (_1 - w * x * (r0 + (_1 - _2 * r0 * x) / _2 * _log((_1 + x) / x)))


@_helper
def _coherent(x):  # type: ignore[no-untyped-def]
    series = _SERIES[0]
    for factor in _SERIES[1:]:
        series = series * x + factor
    share = series if x < _SERIES_BELOW else (_1 - _exp(-x)) / x
    return (_1 + share) / (_2 * (_1 + x) * (_1 + x))


@_helper
def _slopes(tan_bar, cos_x, sin_x):  # type: ignore[no-untyped-def]
    cot_cot = cos_x / max(sin_x, _TINY) / tan_bar
    return _exp(_f(-2 / np.pi) * cot_cot), _exp(_f(-1 / np.pi) * cot_cot * cot_cot)


@_helper
def _roughness(  # type: ignore[no-untyped-def]
    tan_bar, nx, ny, nz, lx, ly, lz, vx, vy, vz, cos_i, cos_e, lamp_steeper
):
    """`brdf._roughness` of one point."""
    lx, ly, lz = lx - cos_i * nx, ly - cos_i * ny, lz - cos_i * nz
    vx, vy, vz = vx - cos_e * nx, vy - cos_e * ny, vz - cos_e * nz
    sin_i, sin_e = np.sqrt(lx * lx + ly * ly + lz * lz), np.sqrt(vx * vx + vy * vy + vz * vz)
    along = lx * vx + ly * vy + lz * vz
    across = abs(nx * (ly * vz - lz * vy) + ny * (lz * vx - lx * vz) + nz * (lx * vy - ly * vx))
    size = np.sqrt(along * along + across * across)
    defined = size > _NO_DIRECTION
    cos_psi = along / size if defined else _1
    tan_half = across / (size + along) if along >= _0 else (size - along) / max(across, size * _MIN_RATIO)
    tan_half = tan_half if defined else _0
    psi = _angle(across, along) if defined else _0
    sin2_half = (_1 - cos_psi) / _2
    chi = _1 / np.sqrt(_1 + _PI * tan_bar * tan_bar)
    e1_i, e2_i = _slopes(tan_bar, cos_i, sin_i)
    e1_e, e2_e = _slopes(tan_bar, cos_e, sin_e)
    eta_i = chi * (cos_i + sin_i * tan_bar * e2_i / (_2 - e1_i))
    eta_e = chi * (cos_e + sin_e * tan_bar * e2_e / (_2 - e1_e))
    e1_steep, e1_flat = (e1_i if lamp_steeper else e1_e), (e1_e if lamp_steeper else e1_i)
    e2_steep, e2_flat = (e2_i if lamp_steeper else e2_e), (e2_e if lamp_steeper else e2_i)
    both = _2 - e1_flat - psi / _PI * e1_steep
    tilt_steep = tan_bar * (cos_psi * e2_flat + sin2_half * e2_steep) / both
    tilt_flat = tan_bar * (e2_flat - sin2_half * e2_steep) / both
    eff_i = chi * (cos_i + sin_i * (tilt_steep if lamp_steeper else tilt_flat))
    eff_e = chi * (cos_e + sin_e * (tilt_flat if lamp_steeper else tilt_steep))
    hidden = _exp(-_2 * tan_half)
    steep = cos_i / eta_i if lamp_steeper else cos_e / eta_e
    return eff_i, eff_e, eff_e / eta_e / eta_i * chi / (_1 - hidden + hidden * chi * steep)


@_loop
def _hapke(  # type: ignore[no-untyped-def]
    normal, to_lamp, to_viewer, w, b, c, b_s0, h_s, b_c0, h_c, tan_bar, porosity, r0, by_phase, factor, values
):  # fmt: skip
    """`brdf.hapke` times a factor; `by_phase`: select the steeper ray as in `brdf.hapke_chrono`."""
    lobes = (_1 - b * b) / _2
    scale = porosity * w / (_4 * _PI)
    for k in range(len(values)):
        x, y, z = 3 * k, 3 * k + 1, 3 * k + 2
        nx, ny, nz = normal[x], normal[y], normal[z]
        lx, ly, lz = to_lamp[x], to_lamp[y], to_lamp[z]
        vx, vy, vz = to_viewer[x], to_viewer[y], to_viewer[z]
        cos_i, cos_e = nx * lx + ny * ly + nz * lz, nx * vx + ny * vy + nz * vz
        cos_g = lx * vx + ly * vy + lz * vz
        if tan_bar > _0:
            lamp_steeper = cos_i >= (cos_g if by_phase else cos_e)
            eff_i, eff_e, shading = _roughness(tan_bar, nx, ny, nz, lx, ly, lz, vx, vy, vz, cos_i, cos_e, lamp_steeper)
        else:
            eff_i, eff_e, shading = cos_i, cos_e, _1 / cos_i
        ax, ay, az, sx, sy, sz = lx - vx, ly - vy, lz - vz, lx + vx, ly + vy, lz + vz
        tan_half = np.sqrt((ax * ax + ay * ay + az * az) / max(sx * sx + sy * sy + sz * sz, _TINY))
        back, forward = _1 + b * b - _2 * b * cos_g, _1 + b * b + _2 * b * cos_g
        single = lobes * ((_1 + c) / (back * np.sqrt(back)) + (_1 - c) / (forward * np.sqrt(forward)))
        single = single * (_1 + b_s0 / (_1 + tan_half / h_s))
        multiple = _chandrasekhar(eff_i / porosity, w, r0)
        multiple = multiple * _chandrasekhar(eff_e / porosity, w, r0) - _1
        value = scale * eff_i / (eff_i + eff_e) * (single + multiple) * shading
        if b_c0 > _0:
            value = value * (_1 + b_c0 * _coherent(tan_half / h_c))
        values[k] = factor * value if cos_i > _GRAZING and cos_e > _GRAZING else _0


@_helper
def _fifth(x):  # type: ignore[no-untyped-def]
    return (x * x) * (x * x) * x


@_loop
def _principled(  # type: ignore[no-untyped-def]
    normal, to_lamp, to_viewer, albedo, rough2, alpha2, eta, eta2, metallic, dielectric, base, not_base, values
):
    """`brdf.principled`; `albedo` is that of the diffuse lobe over pi, other arguments as named in `reflectance`."""
    for k in range(len(values)):
        x, y, z = 3 * k, 3 * k + 1, 3 * k + 2
        nx, ny, nz = normal[x], normal[y], normal[z]
        lx, ly, lz = to_lamp[x], to_lamp[y], to_lamp[z]
        vx, vy, vz = to_viewer[x], to_viewer[y], to_viewer[z]
        cos_i, cos_e = nx * lx + ny * ly + nz * lz, nx * vx + ny * vy + nz * vz
        hx, hy, hz = lx + vx, ly + vy, lz + vz
        length2 = hx * hx + hy * hy + hz * hz
        cos_d = _HALF * np.sqrt(length2)
        fd90 = _HALF + rough2 * cos_d * cos_d
        diffuse = albedo * (_1 + (fd90 - _1) * _fifth(_1 - cos_i)) * (_1 + (fd90 - _1) * _fifth(_1 - cos_e))
        both = cos_i + cos_e
        px, py, pz = hx - both * nx, hy - both * ny, hz - both * nz
        spread = both * both / length2 * alpha2 + (px * px + py * py + pz * pz) / length2
        density = alpha2 / (_PI * (spread * spread))
        inside = np.sqrt(_1 - (_1 - cos_d * cos_d) / eta2)
        across = (cos_d - eta * inside) / (cos_d + eta * inside)
        along = (eta * cos_d - inside) / (eta * cos_d + inside)
        fresnel = dielectric * ((across * across + along * along) / _2)
        fresnel = fresnel + metallic * (base + not_base * _fifth(_1 - cos_d))
        masking_i = _2 / (cos_i + np.sqrt(cos_i * cos_i + alpha2 * (_1 - cos_i * cos_i)))
        masking_e = _2 / (cos_e + np.sqrt(cos_e * cos_e + alpha2 * (_1 - cos_e * cos_e)))
        value = diffuse + fresnel * density * masking_i * masking_e / _4
        values[k] = value if cos_i > _GRAZING and cos_e > _GRAZING else _0
