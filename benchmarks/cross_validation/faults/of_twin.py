"""Faults seeded into the Exudyn twin."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import pi
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

import exudyn_model.control.laws as twin_control
import exudyn_model.control.motion as twin_motion
import exudyn_model.control.rigid_dynamics as twin_rigid
from benchmarks.cross_validation.faults.seeding import Fault, scaled
from exudyn_model.bodies import flexible_link, shortening
from exudyn_model.bodies import imported as twin_imported
from exudyn_model.bodies.bearing import Load
from exudyn_model.bodies.mechanism import Mass
from exudyn_model.bodies.moments import Surplus
from exudyn_model.bodies.rotation import from_quaternion
from exudyn_model.bodies.transmissions import Transmissions
from exudyn_model.control import nonlinear as twin_nonlinear
from exudyn_model.control.full_dynamics import FullDynamics
from exudyn_model.effects import friction as twin_friction
from exudyn_model.redundant import drive as twin_drive
from exudyn_model.redundant.bodies import modal_body, parts, weld
from exudyn_model.redundant.bodies import rigid as twin_bodies
from robot_model import Actuator, Drive

__all__ = ["TWIN_FAULTS"]

ENGINE = "Exudyn twin"


def _without_steiner(_: Any) -> Any:
    def of(body: Any) -> Mass:
        return Mass(body.mass, body.mass * np.asarray(body.center_of_mass), body.inertia_matrix)

    return staticmethod(of)


def _products_exchanged(add_mass: Any) -> Any:
    def exchanged(mbs: Any, node: int, mass: Mass, **keys: Any) -> int:
        j = mass.inertia.copy()
        j[0, 2], j[1, 2] = mass.inertia[1, 2], mass.inertia[0, 2]
        j[2, 0], j[2, 1] = j[0, 2], j[1, 2]
        return int(add_mass(mbs, node, replace(mass, inertia=j), **keys))

    return exchanged


def _rotors_by(factor: float) -> Callable[[Any], Any]:
    def made(start: Any) -> Any:
        def changed(self: Any, *a: Any, rotors: np.ndarray, **k: Any) -> None:
            start(self, *a, rotors=factor * rotors, **k)

        return changed

    return made


def _gearless(drive: Drive) -> Actuator | None:
    return drive.actuator and drive.actuator.model_copy(update={"gear_ratio": 1.0})


def _stribeck_exponent(_: Any) -> Any:
    def level(velocity: float, *, coulomb: float, static: float, stribeck_velocity: float) -> float:
        return coulomb + (static - coulomb) * float(np.exp(-abs(velocity) / stribeck_velocity))

    return level


def _arms_exchanged(moment: Any) -> Any:
    def exchanged(self: Load, bearing: Any) -> float:
        arms = {"radial_arm": bearing.axial_arm, "axial_arm": bearing.radial_arm}
        return float(moment(self, bearing.model_copy(update=arms)))

    return exchanged


def _bristle_with_sign(advance: Any) -> Any:
    def changed(self: Any, now: Any, memory: Any) -> Any:
        force, (z,) = advance(self, now, memory)
        level = self._floored(now, now.velocity, now.command, now.load)
        slip = self._stiffness(now.load) * now.velocity * z / level  # |v| z / g without the bars
        return force + 2 * self.bristle_damping * min(slip, 0.0), (z,)

    return changed


def _without_velocity(outward: Any) -> Any:
    return lambda *a, rate, **k: outward(*a, rate=0.0, **k)


def _hertz(shapes: Any) -> Any:
    return lambda beam: replace(shapes(beam), frequencies=shapes(beam).frequencies / (2 * pi))


def _unbent(add: Any) -> Any:
    """Gravity moment without S0 x: modes get their part, the frame that of the undeformed body."""

    def weigh(mbs: Any, nodes: Any, moments: Any, surplus: Any, gravity: Any) -> Any:
        moved, still = moments.first[:, 1:], moments.first.copy()
        still[:, 1:] = 0.0
        add(mbs, nodes, replace(moments, first=still), surplus, gravity)
        items = modal_body.items

        def pull(_: Any, time: float, item: int, q: Any, v: Any) -> Any:
            rest = np.array(mbs.GetNode(nodes[0])["referenceCoordinates"][3:7])
            down = from_quaternion(rest + np.array(q[3:7])).T @ gravity
            return np.concatenate([np.zeros(7), moved.T @ down])

        if np.any(gravity):
            mbs.AddObject(items.ObjectGenericODE2(nodeNumbers=list(nodes), forceUserFunction=pull))

    return weigh


def _straight(motion: Any) -> Any:
    """Nodes at the positions of the straight link."""

    def changed(self: Any, node: int, x: Any, v: Any) -> Any:
        found = motion(self, node, x, v)
        still = np.zeros(3)
        return replace(found, place=self.nodes[node], slide=0 * found.slide, slides=still)

    return changed


def _unturned(motion: Any) -> Any:
    """A joint's frame that does not rotate with its node."""

    def changed(self: Any, link: Any, index: int) -> None:
        motion(self, link, index)
        self._half = 0 * self._half

    return changed


def _modes_held(needed: Any) -> Any:
    """Modal rates missing in the controller's model."""

    def changed(self: Any, *a: Any, inner: Any = None, **k: Any) -> Any:
        return needed(self, *a, inner=inner and replace(inner, modal_rates=0 * inner.modal_rates), **k)

    return changed


def _turned_about_xyz(_: Any) -> Any:
    return lambda rpy: Rotation.from_euler("XYZ", rpy).as_matrix()


def _errors_alone(_: Any) -> Any:
    return lambda self, state: self.errors(state)


def _forces_as_motion(_: Any) -> Any:
    """q = T m used for forces too: the joint forces are wrong."""
    return lambda self, motors: self.to_joints(motors)


def _each_alone(inertia: Any) -> Any:
    """Rotors without the inertial coupling of joints."""
    return lambda self, *a, **k: np.diag(np.diag(inertia(self, *a, **k)))


TWIN_FAULTS: tuple[Fault, ...] = (
    Fault(
        ENGINE,
        "Coulomb friction drives instead of braking",
        [(twin_friction.CoulombFriction, "force", scaled(-1))],
    ),
    Fault(
        ENGINE,
        "Stribeck friction falls with exponent 1",
        [(twin_friction, "stribeck_level", _stribeck_exponent)],
    ),
    Fault(
        ENGINE,
        "LuGre's bristle rate with v z / g, without the bars of |v|",
        [(twin_friction.LuGreFriction, "advance", _bristle_with_sign)],
    ),
    Fault(
        ENGINE, "radial and axial arm of the bearing exchanged", [(Load, "friction_moment", _arms_exchanged)]
    ),
    Fault(ENGINE, "parallel-axis term of the inertia left out", [(Mass, "of", _without_steiner)]),
    Fault(
        ENGINE,
        "products of inertia xz and yz exchanged",
        [
            (twin_bodies, "add_mass", _products_exchanged),
            (modal_body, "add_mass", _products_exchanged),
        ],
    ),
    Fault(
        ENGINE,
        "rotor inertia with the gear ratio once, not squared",
        [(twin_drive.Drive, "__init__", _rotors_by(1 / 40))],
    ),
    Fault(
        ENGINE,
        "forces of coupled motors reach the joints as their motion does",
        [(Transmissions, "forces_on_joints", _forces_as_motion)],
    ),
    Fault(
        ENGINE,
        "rotors of coupled motors as if each moved one joint",
        [(Transmissions, "inertia", _each_alone)],
    ),
    Fault(ENGINE, "joint frames by Rx Ry Rz instead of Rz Ry Rx", [(parts, "from_rpy", _turned_about_xyz)]),
    Fault(
        ENGINE,
        "network learns from the position error alone",
        [(twin_nonlinear.AdaptiveNetworkLaw, "_surface", _errors_alone)],
    ),
    Fault(ENGINE, "computed torque without velocity terms", [(twin_rigid, "_outward", _without_velocity)]),
    Fault(
        ENGINE,
        "way back to the held attitude with the wrong sign",
        [(twin_control, "to_quaternion", lambda f: lambda r, **k: f(r.T, **k))],
    ),
    Fault(
        ENGINE,
        "voltage servo without the gear ratio",
        [(twin_control, "_motor", lambda f: lambda drive: f(replace(drive, actuator=_gearless(drive))))],
    ),
    Fault(ENGINE, "frequencies of a sine in rad/s for Hz", [(twin_motion, "pi", lambda _: 0.5)]),
    Fault(ENGINE, "modal stiffness from frequencies in Hz", [(flexible_link, "beam_shapes", _hertz)]),
    Fault(ENGINE, "modal damping zeta w for 2 zeta w", [(flexible_link, "damping_of", scaled(0.5))]),
    Fault(
        ENGINE,
        "gravity turns a bent link about its unbent centre of mass, as in Exudyn's own load",
        [(modal_body, "add_modal_weight", _unbent)],
    ),
    Fault(
        ENGINE,
        "shortening by bending one per cent too large",
        [(shortening, "WEIGHTS", lambda weights: 1.01 * weights)],
    ),
    Fault(
        ENGINE,
        "shortening takes no part in Coriolis and centrifugal forces",
        [(Surplus, "force", lambda force: lambda *a: 0 * force(*a))],
    ),
    Fault(
        ENGINE,
        "masses that couple displacements with rotations left out",
        [(twin_imported, "_surplus", lambda _: lambda *a: None)],
    ),
    Fault(
        ENGINE,
        "the full controller forgets the rates of bent links' modes",
        [(FullDynamics, "needed", _modes_held)],
    ),
    Fault(
        ENGINE,
        "a joint stays where the straight link has it",
        [(flexible_link.FlexibleLink, "motion", _straight)],
    ),
    Fault(ENGINE, "a joint's frame does not turn with its bent link", [(weld._Weld, "__init__", _unturned)]),
)
