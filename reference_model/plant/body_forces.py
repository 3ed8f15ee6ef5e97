"""All force effects on bodies, combined into one function of the mechanism's state."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from reference_model.dynamics.equations import Mechanism
from reference_model.dynamics.joints import node_of, node_step
from reference_model.dynamics.outside import Outside
from reference_model.dynamics.tree import Tree
from reference_model.effects.body_force import BodySignals, ForceEffect
from reference_model.effects.catalogue import UsedEffect
from reference_model.kinematics.spatial import constant, rotation_from_rpy, skew
from robot_model import Robot

__all__ = ["BodyForces", "point_on"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class _Acting:
    """One effect: its point of action and its states."""

    effect: ForceEffect
    parameters: Mapping[str, float]
    body: int
    rows: slice


class BodyForces:
    """The force effects on bodies, with their parameters.

    Args:
        robot: the true robot.
        tree: of the robot.
        effects: checked effects; those of other kinds are ignored.
        preload: wrench on the base [force; moment] about its origin in inertial axes, shared by effects that
            balance the initial load, shape (6,).

    Attributes:
        states: total number of internal states.
        initial: the states at time 0, shape (states,).
    """

    def __init__(
        self, robot: Robot, tree: Tree, effects: Sequence[UsedEffect], preload: Array | None = None
    ) -> None:
        self._home = np.asarray(robot.base.position, dtype=float), rotation_from_rpy(robot.base.rpy)
        self._acting: list[_Acting] = []
        self._preload = np.zeros(6) if preload is None else preload
        start: list[float] = []
        for used in effects:
            if isinstance(used.effect, ForceEffect) and used.effect.acts(used.parameters):
                rows = slice(len(start), len(start) + used.effect.states)
                start += used.effect.initial_state(used.parameters)
                self._acting.append(_Acting(used.effect, used.parameters, tree.index(used.at), rows))
        self.states, self.initial = len(start), np.array(start)

    @property
    def acts(self) -> bool:
        """Whether there are any."""
        return bool(self._acting)

    @property
    def carries_start(self) -> bool:
        """Whether one of them balances the initial load of the base."""
        return any(acting.effect.carries_start for acting in self._acting)

    def fastest(self, masses: Mapping[int, float]) -> float:
        """Upper bound of the natural frequencies that they cause [rad/s], from the masses of bodies [kg]."""
        bounds = (a.effect.fastest(a.parameters, masses.get(a.body, np.inf)) for a in self._acting)
        return max(bounds, default=0.0)

    def act(self, mechanism: Mechanism, time: ca.SX, states: ca.SX) -> Outside:
        """Their forces in a state of the mechanism."""
        columns: dict[int, ca.SX] = {}
        spins: dict[int, ca.SX] = {}
        rates, stored, power = ca.SX(self.states, 1), ca.SX(1, 1), ca.SX(1, 1)
        for acting in self._acting:
            effect, p, z = acting.effect, acting.parameters, states[acting.rows]
            signals, spread = self._point(mechanism, acting, time)
            wrench = effect.wrench(signals, p, z)
            stored += effect.stored(signals, p, z)
            power += effect.power(signals, p, z)
            if effect.states:
                rates[acting.rows] = effect.state_rate(signals, p, z)
            if effect.carries_start:
                held = self._held(signals)
                wrench += held
                power += ca.dot(held, signals.velocity)
            body = acting.body
            columns[body] = columns.get(body, 0) + spread.T @ wrench
            spins[body] = spins.get(body, 0) + effect.spin(signals, p, z)
        return Outside(columns, spins, stored, rates, power)

    def _held(self, signals: BodySignals) -> ca.SX:
        """The constant wrench that balances the initial load, in the axes at the point."""
        force, moment = constant(self._preload[:3]), constant(self._preload[3:])
        return ca.vertcat(signals.rotation.T @ force, signals.rotation.T @ moment)

    def _point(self, mechanism: Mechanism, acting: _Acting, time: ca.SX) -> tuple[BodySignals, ca.SX]:
        place = np.asarray(acting.effect.point(acting.parameters), dtype=float)
        return point_on(mechanism, acting.body, place, time, self._home)


def point_on(
    mechanism: Mechanism, body: int, place: Array, time: ca.SX, home: tuple[Array, Array]
) -> tuple[BodySignals, ca.SX]:
    """Motion of a point of a body, and its Jacobian with respect to the velocity column, 6 x (6 + s).

    Args:
        mechanism: in its state.
        body: index in the tree.
        place: of the point in the body's frame [m], shape (3,); on a flexible body the nearest node is used.
        time: [s].
        home: position and rotation of the base's frame at the start, shapes (3,) and (3, 3).
    """
    state, flexible = mechanism.states[body], mechanism.tree.bodies[body].flexible
    if flexible is not None:
        node = int(np.linalg.norm(flexible.nodes - place, axis=1).argmin())
        rate = state.velocity[6:]
        step = node_step(node_of(flexible, node, state.modal, rate), state.velocity[:6], rate)
        spread, turn, shift = ca.horzcat(step.transfer, step.columns), step.rotation, step.shift
    else:
        arm = constant(place)
        spread = ca.blockcat([[ca.SX.eye(3), -skew(arm)], [ca.SX(3, 3), ca.SX.eye(3)]])
        turn, shift = ca.SX.eye(3), arm
    signals = BodySignals(
        time,
        state.position + state.rotation @ shift,
        state.rotation @ turn,
        spread @ state.velocity,
        *home,
    )
    return signals, spread
