"""One step of an effect's internal states along known signals, as a CasADi expression.

Within a step the signals are linear from one sample to the next. Bristles are stiff (rates of 1e5 per
second), so both formulas treat the linear part implicitly and keep a sliding bristle at its moving
equilibrium.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import casadi as ca

__all__ = ["Rate", "step"]

#: zd = rate(z, signals).
Rate = Callable[[ca.SX, ca.SX], ca.SX]

#: L-stable choice of the two-stage Rosenbrock method's parameter.
GAMMA = 1 - 1 / math.sqrt(2)
#: Below this argument the exponential's divided differences are summed as series, to avoid cancellation;
#: the term after the last of SERIES_TERMS is then below 1e-15.
SERIES_BELOW = 0.1
SERIES_TERMS = 10


def step(rate: Rate, z: ca.SX, start: ca.SX, stop: ca.SX, duration: ca.SX) -> ca.SX:
    """The states after one step; second order, and stable for arbitrarily fast states.

    Args:
        rate: right-hand side.
        z: states at the start, n x 1.
        start, stop: signals at both ends.
        duration: [s].
    """
    return (_exponential if z.shape[0] == 1 else _rosenbrock)(rate, z, start, stop, duration)


def _exponential(rate: Rate, z: ca.SX, start: ca.SX, stop: ca.SX, duration: ca.SX) -> ca.SX:
    """Exponential Rosenbrock step about the middle of the interval.

    Hochbruck and Ostermann, Acta Numerica 19 (2010) 209-286, sec. 2.4, with the time derivative centred:
    z+ = z + h phi1 f + h^2 (phi2 - phi1/2) f_t. Exact when the rate is linear in state and signals with a
    constant coefficient of the state, so for a lag, and for a bristle at constant speed.
    """
    middle = (start + stop) / 2
    value = rate(z, middle)
    slope = (rate(z, stop) - rate(z, start)) / duration
    phi1, phi2 = _phi(duration * ca.jacobian(value, z))
    return z + duration * phi1 * value + duration**2 * (phi2 - phi1 / 2) * slope


def _phi(x: ca.SX) -> tuple[ca.SX, ca.SX]:
    """phi1 = (exp(x) - 1)/x and phi2 = (phi1 - 1)/x."""
    small = ca.fabs(x) < SERIES_BELOW
    safe = ca.if_else(small, ca.SX(-1.0), x)
    phi1 = (ca.exp(safe) - 1) / safe
    phi2 = (phi1 - 1) / safe
    near = ca.if_else(small, x, ca.SX(0.0))
    series = [sum(near**k / math.factorial(k + n) for k in range(SERIES_TERMS)) for n in (1, 2)]
    return ca.if_else(small, series[0], phi1), ca.if_else(small, series[1], phi2)


def _rosenbrock(rate: Rate, z: ca.SX, start: ca.SX, stop: ca.SX, duration: ca.SX) -> ca.SX:
    """ROS2 (Verwer, Spee, Blom, Hundsdorfer, SIAM J. Sci. Comput. 20 (1999) 1456-1480), L-stable."""
    value = rate(z, start)
    slope = GAMMA * (rate(z, stop) - value)  # gamma h f_t
    matrix = ca.SX.eye(z.shape[0]) - GAMMA * duration * ca.jacobian(value, z)
    first = ca.solve(matrix, value + slope)
    second = ca.solve(matrix, rate(z + duration * first, stop) - 2 * first - slope)
    return z + duration * (1.5 * first + 0.5 * second)
