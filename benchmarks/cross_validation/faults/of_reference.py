"""Faults seeded into the reference model."""

from __future__ import annotations

from dataclasses import replace
from math import pi
from typing import Any

import casadi as ca

import reference_model.control.laws as control
import reference_model.dynamics.symbolic as symbolic
import reference_model.flexible.integrals as integrals
import reference_model.kinematics.coupling as coupling
import reference_model.plant.acting as acting
import reference_model.plant.closed_loop as plant
from benchmarks.cross_validation.faults.seeding import Fault, scaled

__all__ = ["REFERENCE_FAULTS"]

ENGINE = "reference"


def _without_gyroscopic(masses: Any) -> Any:
    def changed(*a: Any, **k: Any) -> Any:
        bodies, *rest = masses(*a, **k)
        still = {
            index: replace(body, force=ca.vertcat(body.force[:3], ca.SX(3, 1), body.force[6:]))
            for index, body in bodies.items()
        }
        return (still, *rest)

    return changed


def _without_bias(recursion: Any) -> Any:
    def changed(*a: Any, **k: Any) -> Any:
        return tuple(replace(state, bias=0 * state.bias) for state in recursion(*a, **k))

    return changed


def _first_only(error: Any) -> Any:
    def changed(*a: Any, **k: Any) -> Any:
        astray, drift = error(*a, **k)
        return -astray, drift

    return changed


def _with_apparent(rate: Any) -> Any:
    """omega x v of the base's velocity in base axes missing: adds the subtracted term again."""

    def changed(self: Any, parts: Any, *a: Any, **k: Any) -> Any:
        column = rate(self, parts, *a, **k)
        if self.layout.free_base:
            rows = self.layout.rows("base_velocity")
            linear, omega = parts["base_velocity"][:3], parts["base_velocity"][3:]
            column[rows.start : rows.start + 3] += ca.cross(omega, linear)
        return column

    return changed


def _half_span(load: Any) -> Any:
    def changed(kind: str, axis: Any, wrench: Any, bearing: Any) -> Any:
        span = None if bearing.span is None else bearing.span / 2
        return load(kind, axis, wrench, bearing.model_copy(update={"span": span}))

    return changed


def _transposed(_: Any) -> Any:
    """m = C q with the transposed matrix."""
    return lambda self, joints: joints if self._backward is None else self._backward.T @ joints


def _forces_of_joints(_: Any) -> Any:
    """Forces on the joints from the motors by the inverse matrix."""
    return lambda self, force: force if self._forward is None else self._forward.T @ force


REFERENCE_FAULTS: tuple[Fault, ...] = (
    Fault(ENGINE, "gyroscopic moments of the bodies left out", [(symbolic, "masses", _without_gyroscopic)]),
    Fault(
        ENGINE,
        "velocity-dependent accelerations of the recursion left out",
        [(symbolic, "recursion", _without_bias)],
    ),
    Fault(
        ENGINE,
        "rotary inertia of nodes kept constant in the link's axes",
        [(integrals, "_turned", lambda f: lambda *a: 0 * f(*a))],
    ),
    Fault(ENGINE, "span of two bearings halved", [(symbolic, "bearing_load", _half_span)]),
    Fault(ENGINE, "friction feed-forward with the wrong sign", [(control, "feedforward_sign", scaled(-1))]),
    Fault(ENGINE, "sliding variable reached too fast", [(control, "reaching_acceleration", scaled(1.01))]),
    Fault(ENGINE, "gains in N m per degree", [(control, "_gains", scaled(180 / pi))]),
    Fault(ENGINE, "held base is pushed away", [(control, "base_error", _first_only)]),
    Fault(
        ENGINE,
        "dry friction changes sign over ten times the speed",
        [(acting, "TRANSITION", lambda v: 10 * v)],
    ),
    Fault(
        ENGINE,
        "omega x v of the base's velocity in base axes left out",
        [(plant.Plant, "rate_with", _with_apparent)],
    ),
    Fault(
        ENGINE,
        "motion of coupled motors by the transposed matrix",
        [(coupling.Coupling, "drives", _transposed)],
    ),
    Fault(
        ENGINE,
        "forces of coupled motors on the joints by the matrix of the other way",
        [(coupling.Coupling, "on_joints", _forces_of_joints)],
    ),
    Fault(ENGINE, "quaternion rates with the wrong sign", [(plant, "quaternion_rate", scaled(-1))]),
)
