"""Reference motions as CasADi functions of time."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
from scipy.interpolate import BSpline, make_interp_spline

from robot_model import Cycloid, Hold, JointReference, MultiSine, Quintic, Robot, Table

__all__ = ["has_tables", "reference_function"]


def has_tables(robot: Robot) -> bool:
    """Whether a reference is a table, which only MX graphs can hold; other references are SX expressions."""
    return any(isinstance(item, Table) for item in _items(robot))


def reference_function(robot: Robot) -> ca.Function:
    """time [s] -> position, velocity and acceleration of all moving joints, n x 1 each.

    Joints without a reference motion hold their initial position.
    """
    chosen = {item.joint: item for item in _items(robot)}
    time: Any = (ca.MX if has_tables(robot) else ca.SX).sym("t")
    joints = [
        _motion(chosen.get(joint.name, Hold(joint=joint.name)), joint.initial_position, time)
        for joint in robot.moving_joints
    ]
    columns: list[Any] = [ca.vertcat(*rows) for rows in zip(*joints)] or [ca.SX(0, 1)] * 3
    return ca.Function("reference", [time], [ca.densify(column) for column in columns])


def _items(robot: Robot) -> tuple[JointReference, ...]:
    return robot.reference.joints if robot.reference else ()


def _motion(item: JointReference, start: float, time: Any) -> tuple[Any, Any, Any]:
    """Position, velocity and acceleration of one joint, SX or MX as `time` is."""
    if isinstance(item, Table):
        return _spline(item, time)
    if isinstance(item, Cycloid | Quintic):
        s = ca.fmax(0, ca.fmin(1, (time - item.start) / item.duration))
        shape = s - ca.sin(2 * ca.pi * s) / (2 * ca.pi) if isinstance(item, Cycloid) else _smooth_step(s)
        position = start + item.displacement * shape
    elif isinstance(item, MultiSine):
        phases = item.phases or (0.0,) * len(item.amplitudes)
        waves = [
            a * ca.sin(2 * ca.pi * f * time + phi)
            for a, f, phi in zip(item.amplitudes, item.frequencies, phases)
        ]
        fade = _smooth_step(ca.fmin(1, time / item.ramp)) if item.ramp > 0 else 1
        position = start + fade * sum(waves)
    else:
        position = start + 0 * time
    velocity = ca.jacobian(position, time)
    return position, velocity, ca.jacobian(velocity, time)


def _smooth_step(s: Any) -> Any:
    """10 s^3 - 15 s^4 + 6 s^5: from 0 to 1 with two derivatives zero at both ends."""
    return s**3 * (10 + s * (6 * s - 15))


def _spline(item: Table, time: ca.MX) -> tuple[ca.MX, ca.MX, ca.MX]:
    """Not-a-knot spline and its derivatives; at rest outside the table."""
    spline = make_interp_spline(np.asarray(item.times), np.asarray(item.positions), k=item.degree)
    first, last = item.times[0], item.times[-1]
    inside = ca.logic_and(time >= first, time <= last)
    clipped = ca.fmax(first, ca.fmin(last, time))
    found = [
        _piecewise(spline.derivative(order), clipped) if order <= item.degree else 0 * time
        for order in range(3)
    ]
    return found[0], ca.if_else(inside, found[1], 0), ca.if_else(inside, found[2], 0)


def _piecewise(spline: BSpline, time: ca.MX) -> ca.MX:
    """`spline` at `time`, an expression that can be differentiated with respect to time.

    CasADi differentiates a B-spline of degree 1 into one of degree 0. Evaluated at a knot, that one writes
    before the start of its memory (CasADi 3.8.2, `casadi_nd_boor_eval`), so degrees 1 and 0 are expressed
    differently.
    """
    knots = np.unique(spline.t)
    if spline.k == 0:
        return ca.MX(ca.DM(spline(knots)))[ca.low(ca.DM(knots), time)]
    if spline.k == 1:
        return ca.interpolant("table", "linear", [list(knots)], list(spline(knots)))(time)
    coefficients = spline.c[: len(spline.t) - spline.k - 1]  # SciPy pads those of a derivative
    return ca.Function.bspline("table", [list(spline.t)], list(coefficients), [spline.k], 1)(time)
