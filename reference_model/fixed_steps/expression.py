"""One step of fixed length for robots with stiff friction states, as an expression.

Bristles follow the velocity within microseconds once a joint slides, far below the step of a real-time loop;
everything else is slow. So a step is split symmetrically (Strang, SIAM J. Numer. Anal. 5 (1968) 506-517):
half a step of the effects' states with the mechanism held, a step of the mechanism with those states held,
and half a step of the states again. The mechanism is stepped by the classical method of Runge and Kutta of
order four. The states' own step is the closed form wherever their rate is linear in them and they are
uncoupled (``zd = v - s0 |v| z / g`` of LuGre: z+ = z_ss + (z - z_ss) exp(-s0 |v| dt / g)), and otherwise an
exponential Runge-Kutta step of order two (Cox, Matthews, J. Comp. Phys. 176 (2002) 430-455, equation 22),
so that they do not limit the step.

Total order: four without effect states, two with them.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np

from reference_model.dynamics.balance import LOADS
from reference_model.plant.acting import Signals
from reference_model.plant.closed_loop import Plant
from reference_model.plant.layout import Layout

__all__ = ["fixed_step", "runge_kutta", "unit_quaternions"]

#: Below this the phi functions are taken from their series, whose next term is then below rounding.
SMALL = 1e-5


def fixed_step(
    plant: Plant,
    *,
    time: Any,
    state: Any,
    length: Any,
    goal: Callable[[Any], Any],
    command: Callable[[Any, Any], Any],
) -> Any:
    """The state one step later.

    Args:
        plant: the closed loop.
        time: at the start [s].
        state: at the start, rows x 1, SX or MX.
        length: of the step [s].
        goal: time -> reference position, n x 1.
        command: (time, state) -> command in force, as of `control.command`.
    """
    rows = plant.layout.rows("effects")
    mask = np.ones(plant.layout.size)
    mask[rows] = 0.0

    def rate(instant: Any, at: Any) -> Any:
        return mask * plant.rate(instant, at, goal(instant), command(instant, at))

    if not plant.layout.effect_states:
        return unit_quaternions(plant.layout, runge_kutta(rate, time, state, length))
    hidden = _hidden_step(plant, rows)

    def settle(instant: Any, at: Any) -> Any:
        states = hidden(instant, at, goal(instant), command(instant, at), length / 2)
        return ca.vertcat(at[: rows.start], states, at[rows.stop :])

    moved = runge_kutta(rate, time, settle(time, state), length)
    return settle(time + length, unit_quaternions(plant.layout, moved))


def runge_kutta(rate: Callable[[Any, Any], Any], time: Any, state: Any, length: Any) -> Any:
    """The state after a step of the classical method, of order four; `rate` is of time and state."""
    middle = time + length / 2
    k1 = rate(time, state)
    k2 = rate(middle, state + length / 2 * k1)
    k3 = rate(middle, state + length / 2 * k2)
    k4 = rate(time + length, state + length * k3)
    return state + length / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


def _hidden_step(plant: Plant, rows: slice) -> ca.Function:
    """(t, x, r, command, length) -> the effects' states after `length` with everything else held."""
    time, length = ca.SX.sym("t"), ca.SX.sym("h")
    state, goal = ca.SX.sym("x", plant.layout.size), ca.SX.sym("r", plant.layout.joints)
    command = ca.SX.sym("u", plant.commands)

    def rate(states: ca.SX) -> ca.SX:
        at = ca.vertcat(state[: rows.start], states, state[rows.stop :])
        return plant.rate(time, at, goal, command)[rows]

    own = state[rows]
    slope = _slope(plant, time, state, goal, command, rows)
    first = rate(own)
    decay = length * slope
    ahead = own + length * _phi1(decay) * first
    # N(ahead) - N(own), N the part of the rate beyond the slope: zero where the rate is linear
    change = rate(ahead) - first - slope * (ahead - own)
    found = ahead + length * _phi2(decay) * change
    inputs = [time, state, goal, command, length]
    return ca.Function("hidden", inputs, [ca.densify(found)], {"cse": True})


def _slope(plant: Plant, time: ca.SX, state: ca.SX, goal: ca.SX, command: ca.SX, rows: slice) -> ca.SX:
    """Derivative of each state's rate with respect to itself under given loads, which depend little on it."""
    watched = dict(zip(Plant.WATCHED, plant.watch(time, state, goal, command)))
    parts, joints = plant.layout.split(state), plant.layout.joints
    offset = plant.tree.offset
    moved = watched["acceleration"][offset : offset + joints]
    loads = ca.reshape(watched["loads"], len(LOADS), joints)
    symbols = ca.SX.sym("qdd", joints), ca.SX.sym("u", joints), ca.SX.sym("loads", len(LOADS), joints)
    turning = plant.gears.motion(parts["position"], parts["motor"])
    turned = plant.gears.motion(parts["velocity"], parts["motor_rates"])
    moving = parts["position"], parts["velocity"]
    signals = Signals(time, *moving, *symbols, motor_position=turning, motor_velocity=turned)
    hidden = ca.SX.sym("z", rows.stop - rows.start)
    rates = plant.forces.act(signals, hidden)[1]
    own = ca.diag(ca.jacobian(rates, hidden))
    values = [moved, plant.gears.coupling.on_joints(watched["torque"]), loads, state[rows]]
    (found,) = ca.substitute([ca.densify(own)], [*symbols, hidden], values)
    return found


def _phi1(x: ca.SX) -> ca.SX:
    """(e^x - 1) / x."""
    small = ca.fabs(x) < SMALL
    divisor = ca.if_else(small, 1.0, x)
    return ca.if_else(small, 1 + x / 2 * (1 + x / 3), ca.expm1(divisor) / divisor)


def _phi2(x: ca.SX) -> ca.SX:
    """(e^x - 1 - x) / x^2."""
    small = ca.fabs(x) < SMALL
    divisor = ca.if_else(small, 1.0, x)
    return ca.if_else(small, 0.5 + x / 6 * (1 + x / 4), (ca.expm1(divisor) / divisor - 1) / divisor)


def unit_quaternions(layout: Layout, state: Any) -> Any:
    """The state with quaternions of unit length."""
    parts = layout.split(state)
    found = []
    for name, part in parts.items():
        if name in ("attitude", "balls"):
            part = ca.vertcat(*(_normal(part[k : k + 4]) for k in range(0, part.shape[0], 4)))
        found.append(part)
    return ca.vertcat(*(part for part in found if part.shape[0]))


def _normal(quaternion: Any) -> Any:
    return quaternion / ca.sqrt(ca.sumsqr(quaternion))
