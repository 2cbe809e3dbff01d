"""Sine, cosine, tangent and arctangents of whole vectors.

Range reductions and polynomials are those of fdlibm (© 1993 Sun Microsystems, freely granted),
without its branches. Errors stay below 1 ulp for sin and cos, 2 for atan and atan2, 3 for tan.
Arguments outside the range of a reduction go to the C library.
"""

from __future__ import annotations

from collections.abc import Sequence

from flexctrl.kernels.llvm_writer import Writer

_LARGE_ANGLE = 1e5
_LARGE_SIDE = 1e300
# π/2 in pieces: products of the first two with a whole number below 2²⁰ are exact
_HALF_PI = (1.57079632673412561417e00, 6.07710050630396597660e-11, 2.02226624879595063154e-21)
_TWO_OVER_PI = 6.36619772367581382433e-01
_ROUND = 6755399441055744.0  # 1.5·2⁵²: adding it leaves the nearest whole number in the low bits
_SIN = (
    *(8.33333333332248946124e-03, -1.98412698298579493134e-04, 2.75573137070700676789e-06),
    *(-2.50507602534068634195e-08, 1.58969099521155010221e-10),
)
_SIN_CUBE = -1.66666666666666324348e-01
_COS = (
    *(4.16666666666666019037e-02, -1.38888888888741095749e-03, 2.48015872894767294178e-05),
    *(-2.75573143513906633035e-07, 2.08757232129817482790e-09, -1.13596475577881948265e-11),
)
_ATAN = (
    *(3.33333333333329318027e-01, -1.99999999998764832476e-01, 1.42857142725034663711e-01),
    *(-1.11111104054623557880e-01, 9.09088713343650656196e-02, -7.69187620504482999495e-02),
    *(6.66107313738753120669e-02, -5.83357013379057348645e-02, 4.97687799461593236017e-02),
    *(-3.65315727442169155270e-02, 1.62858201153657823623e-02),
)
_QUARTER_PI = (7.85398163397448278999e-01, 3.06161699786838301793e-17)
_RIGHT_ANGLE = (1.57079632679489655800e00, 6.12323399573676603587e-17)
_PI = (3.14159265358979311600e00, 1.22464679914735317720e-16)


def sin(w: Writer, x: str) -> str:
    """Return sin x."""
    quadrant, s, c = _sin_cos(w, x)
    sign = w.on_bits("shl", w.on_bits("and", quadrant, 2), 62)
    return w.unless(_is_large(w, x), w.flip_sign(w.select(_is_odd(w, quadrant), c, s), sign), "sin", x)


def cos(w: Writer, x: str) -> str:
    """Return cos x."""
    quadrant, s, c = _sin_cos(w, x)
    sign = w.on_bits("shl", w.on_bits("and", w.on_bits("add", quadrant, 1), 2), 62)
    return w.unless(_is_large(w, x), w.flip_sign(w.select(_is_odd(w, quadrant), s, c), sign), "cos", x)


def tan(w: Writer, x: str) -> str:
    """Return tan x."""
    quadrant, s, c = _sin_cos(w, x)
    odd = _is_odd(w, quadrant)
    quotient = w.div(w.select(odd, c, s), w.select(odd, s, c))
    return w.unless(_is_large(w, x), w.flip_sign(quotient, w.on_bits("shl", quadrant, 63)), "tan", x)


def atan(w: Writer, x: str) -> str:
    """Return arctan x."""
    return w.intrinsic("copysign", _angle(w, w.intrinsic("fabs", x), w.constant(1.0)), x)


def atan2(w: Writer, y: str, x: str) -> str:
    """Return the angle of the point (x, y), in (−π, π]."""
    a, b = w.intrinsic("fabs", y), w.intrinsic("fabs", x)
    angle = _angle(w, a, b)
    behind = w.sub(w.constant(_PI[0]), w.sub(angle, w.constant(_PI[1])))
    left = w.value(f"icmp slt {w.integer} {w.bits(x)}, {w.integers(0)}")
    result = w.intrinsic("copysign", w.select(left, behind, angle), y)
    return w.unless(w.compare("ogt", w.add(a, b), w.constant(_LARGE_SIDE)), result, "atan2", y, x)


def _is_large(w: Writer, x: str) -> str:
    return w.compare("ogt", w.intrinsic("fabs", x), w.constant(_LARGE_ANGLE))


def _is_odd(w: Writer, quadrant: str) -> str:
    return w.value(f"icmp ne {w.integer} {w.on_bits('and', quadrant, 1)}, {w.integers(0)}")


def _sin_cos(w: Writer, x: str) -> tuple[str, str, str]:
    """Quadrant number k, sin r and cos r of x = k π/2 + r, |r| ≤ π/4."""
    shifted = w.add(w.mul(x, w.constant(_TWO_OVER_PI)), w.constant(_ROUND))
    k = w.sub(shifted, w.constant(_ROUND))
    p1, p2, p3 = (w.mul(k, w.constant(p)) for p in _HALF_PI)
    t = w.sub(x, p1)
    r = w.sub(t, p2)
    lost = w.sub(p3, w.sub(w.sub(t, r), p2))
    high = w.sub(r, lost)
    low = w.sub(w.sub(r, high), lost)
    return w.bits(shifted), _small_sin(w, high, low), _small_cos(w, high, low)


def _small_sin(w: Writer, x: str, low: str) -> str:
    z = w.mul(x, x)
    v = w.mul(z, x)
    tail = w.sub(w.mul(w.constant(0.5), low), w.mul(v, _polynomial(w, z, _SIN)))
    return w.sub(x, w.sub(w.sub(w.mul(z, tail), low), w.mul(v, w.constant(_SIN_CUBE))))


def _small_cos(w: Writer, x: str, low: str) -> str:
    z = w.mul(x, x)
    half, one = w.mul(w.constant(0.5), z), w.constant(1.0)
    first = w.sub(one, half)
    rounding = w.sub(w.sub(one, first), half)
    tail = w.sub(w.mul(z, w.mul(z, _polynomial(w, z, _COS))), w.mul(x, low))
    return w.add(first, w.add(rounding, tail))


def _angle(w: Writer, a: str, b: str) -> str:
    """Angle in [0, π/2] of a point with sides a, b ≥ 0: base angle + arctan of a quotient below 7/16."""
    low = w.compare("ole", a, w.mul(b, w.constant(7 / 16)))  # the origin too
    high = w.compare("olt", w.mul(a, w.constant(7 / 16)), b)
    steep = w.select(high, w.sub(a, b), w.neg(b))
    top = w.select(low, a, steep)
    bottom = w.select(low, b, w.select(high, w.add(a, b), a))
    at_origin = w.compare("oeq", bottom, w.constant(0.0))
    x = w.div(top, w.select(at_origin, w.constant(1.0), bottom))
    z = w.mul(x, x)
    bend = w.mul(x, w.mul(z, _polynomial(w, z, _ATAN)))
    base, rest = (
        w.select(low, w.constant(0.0), w.select(high, w.constant(quarter), w.constant(right)))
        for quarter, right in zip(_QUARTER_PI, _RIGHT_ANGLE, strict=True)
    )
    return w.sub(base, w.sub(w.sub(bend, rest), x))


def _polynomial(w: Writer, z: str, coefficients: Sequence[float]) -> str:
    """Coefficients from the lowest power up. Even and odd powers apart: half the waiting."""
    if len(coefficients) <= 2:
        return _horner(w, z, coefficients)
    square = w.mul(z, z)
    even, odd = _horner(w, square, coefficients[::2]), _horner(w, square, coefficients[1::2])
    return w.add(even, w.mul(z, odd))


def _horner(w: Writer, z: str, coefficients: Sequence[float]) -> str:
    result = w.constant(coefficients[-1])
    for c in reversed(coefficients[:-1]):
        result = w.add(w.constant(c), w.mul(z, result))
    return result
