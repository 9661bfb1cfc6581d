"""Sines, cosines and arc tangents of wide lanes, to the last bits of float64."""

from __future__ import annotations

import math
from typing import Any

from rrtik_ompl.kernels.simd.compiled import inlined, kernel
from rrtik_ompl.kernels.simd.lanes import absolute, choose, floor, larger, nearest, smaller, square_root

TAU, HALF_TURN, QUARTER, EIGHTH = math.tau, math.pi, 0.5 * math.pi, 0.25 * math.pi
QUARTER_HIGH, QUARTER_LOW = float.fromhex("0x1.921fb544p+0"), 6.077100506506192e-11  # multiples of the first are exact
TANGENT = math.tan(math.pi / 8.0)
SMALLEST_DIVISOR = 1e-300

# Taylor's series for |x| <= pi / 4: what is left out is less than 1e-16 of the last bit.
SINE = tuple((-1.0) ** k / math.factorial(2 * k + 1) for k in range(1, 9))
COSINE = tuple((-1.0) ** k / math.factorial(2 * k) for k in range(2, 10))
# atan t = t + t z P(z) with z = t^2 for |t| <= tan(pi / 8), fitted to the smallest greatest error [45]: 3e-19.
ARC = (
    -0.33333333333332954,
    0.1999999999989963,
    -0.14285714275748934,
    0.11111110593658576,
    -0.09090892969913304,
    0.07691984055254814,
    -0.06662318771075713,
    0.058426489131982576,
    -0.05017458328436045,
    0.03754733975597697,
    -0.017376257377601848,
)


@inlined
def polynomial(coefficients: Any, z: Any) -> Any:
    """By Horner's rule, the constant first."""
    value = z * 0.0 + coefficients[-1]
    for k in range(len(coefficients) - 2, -1, -1):
        value = value * z + coefficients[k]
    return value


@kernel
def wide_sine_and_cosine(angle: Any) -> Any:
    """Sine and cosine of angles up to 1e5 [rad]."""
    quarters = nearest(angle * (1.0 / QUARTER))
    x = (angle - quarters * QUARTER_HIGH) - quarters * QUARTER_LOW
    quarter = quarters - floor(quarters * 0.25) * 4.0  # 0, 1, 2 or 3
    z = x * x
    sine = x + x * z * polynomial(SINE, z)
    cosine = (1.0 - 0.5 * z) + z * z * polynomial(COSINE, z)
    odd = absolute(absolute(quarter - 2.0) - 1.0) < 0.5
    turned_sine = choose(odd, cosine, sine)
    turned_cosine = choose(odd, sine, cosine)
    return (
        choose(quarter > 1.5, -turned_sine, turned_sine),
        choose(absolute(quarter - 1.5) < 1.0, -turned_cosine, turned_cosine),
    )


@kernel
def arc_tangent(y: Any, x: Any) -> Any:
    """The angle of points (x, y) in (-pi, pi]; 0 at the origin."""
    wide = absolute(x)
    high = absolute(y)
    most = larger(larger(wide, high), SMALLEST_DIVISOR)
    least = smaller(wide, high)
    steep = least > most * TANGENT
    t = choose(steep, least - most, least) / choose(steep, least + most, most)
    z = t * t
    angle = t + t * z * polynomial(ARC, z)
    angle = choose(steep, angle + EIGHTH, angle)
    angle = choose(high > wide, QUARTER - angle, angle)
    angle = choose(x < 0.0, HALF_TURN - angle, angle)
    return choose(y < 0.0, -angle, angle)


@inlined
def arc_sine(sine: Any) -> Any:
    """The angle in [0, pi / 2] whose sine is given, from 0 to 1."""
    return arc_tangent(sine, square_root((1.0 - sine) * (1.0 + sine)))


@inlined
def within_half_turn(angle: Any) -> Any:
    """Angles moved by full turns into (-pi, pi]."""
    return angle + TAU * floor(0.5 - angle * (1.0 / TAU))


@inlined
def opposite(angle: Any) -> Any:
    """The angle half a turn away, in (-pi, pi], for angles that are there too."""
    return choose(angle > 0.0, angle - HALF_TURN, angle + HALF_TURN)
