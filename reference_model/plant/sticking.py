"""The closed loop with exact stick and slip: every joint slides forwards, backwards, or is held.

Dry friction is a force between bounds while a joint rests, and the bound itself while it slides. So a joint
has a mode m: 1 or -1 for sliding in that direction, where friction is its law with sgn(qd) = m; and 0 for
sticking, where friction keeps the acceleration at zero, as long as it lies between the laws of the two
directions at rest. Within one set of modes the equations are smooth.

    stick:  qdd = 0,  T(1) <= T <= T(-1);      slip:  T = T(m),  m qd >= 0

T is the total force of effects on the joint; bounds depend on the bearing loads where friction does, and the
loads on all joints' forces, so both are solved together (Glocker, Set-Valued Force Laws, 2001, ch. 3).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import casadi as ca
import numpy as np

from reference_model.dynamics.balance import LOADS
from reference_model.plant.acting import Signals
from reference_model.plant.closed_loop import Plant
from reference_model.plant.loop import Affine, fixed_point
from reference_model.plant.response import Response
from robot_model import Robot

__all__ = ["StickingPlant"]


class StickingPlant(Plant):
    """A `Plant` whose `rate` and `watch` take the modes of the joints as a last argument, n x 1.

    Args:
        robot: the description.
        work, losses: as of a `Plant`.

    Attributes:
        dry: joints that can stick, those with a friction law that jumps at a reversal.
        verdict: (t, x, r, command, mode) -> margin, joint accelerations, residual of the loop. The margin of
            a sticking joint is the distance of the holding force from the nearer bound, relative to 1 + the
            bounds [-]; that of a sliding one is its speed in the direction of the mode [rad/s or m/s].
    """

    def __init__(
        self, robot: Robot, *, work: bool = False, losses: bool = False, mode: ca.SX | None = None
    ) -> None:
        self.mode = ca.SX.sym("mode", len(robot.moving_joints)) if mode is None else mode
        super().__init__(robot, work=work, losses=losses)

    @property
    def direction(self) -> ca.SX:
        """The mode of every joint, n x 1."""
        assert self.mode is not None
        return self.mode

    @property
    def held(self) -> ca.SX:
        """Accelerations of joints of mode 0 [rad/s^2 or m/s^2], n x 1: none while they stick."""
        return ca.SX(len(self.robot.moving_joints), 1)

    @property
    def dry(self) -> tuple[int, ...]:
        """Places of the joints with a law that depends on the direction."""
        count = len(self.robot.moving_joints)
        q, qd, qdd, u, direction = (ca.SX.sym(name, count) for name in ("q", "qd", "qdd", "u", "m"))
        signals = Signals(ca.SX.sym("t"), q, qd, qdd, u, ca.SX.sym("loads", len(LOADS), count), direction)
        total = self.forces.act(signals, ca.SX.sym("z", self.forces.states))[0]
        return tuple(k for k in range(count) if ca.depends_on(total[k], direction))

    def _settle(
        self, forces: Callable[[ca.SX], ca.SX], caused: Callable[[ca.SX], ca.SX]
    ) -> tuple[ca.SX, ca.SX]:
        directions, moved = self.direction, self.held
        affine, shift = Affine.of(caused, self.layout.joints), ca.SX(self.tree.rows, 1)
        for k in self.dry:
            shift[self._row(k)] = ca.if_else(directions[k] == 0, moved[k], 0)
        shift = ca.vertcat(shift, ca.SX(affine.constant.shape[0] - self.tree.rows, 1))
        holds = {k: (directions[k] == 0, self._row(k)) for k in self.dry}
        beyond = Affine(affine.constant - shift, affine.slope)
        force = fixed_point(lambda column: forces(column + shift), beyond, holds)
        column = affine.at(force)
        for k in self.dry:  # only rounding remains there, and rest must be exact
            column[self._row(k)] = ca.if_else(directions[k] == 0, moved[k], column[self._row(k)])
        return force, column

    def _row(self, joint: int) -> int:
        """Place of a joint's acceleration among the generalised ones."""
        return joint + (6 if self.layout.free_base else 0)

    def _response(self, seen: Signals, states: ca.SX, force: ca.SX, acceleration: ca.SX) -> Response:
        total, rates, friction = self.forces.act(seen, states)
        ahead, behind = (self.forces.act(_towards(seen, sign), states)[0] for sign in (1.0, -1.0))
        between = ca.fmin(force - ahead, behind - force) / (1 + ca.fmax(ca.fabs(ahead), ca.fabs(behind)))
        stuck = ca.SX.zeros(force.shape[0])
        for k in self.dry:
            stuck[k] = self.direction[k] == 0
        margin = ca.if_else(stuck, between, self.direction * seen.velocity)
        errors = ca.if_else(stuck, 0, ca.fabs(total - force) / (1 + ca.fabs(total)))
        residual = ca.mmax(ca.vertcat(0, errors))  # maybe no joints
        friction = friction + ca.if_else(stuck, force - total, 0)
        return Response(acceleration, friction, seen.loads, rates, residual, margin)

    def _judge(self, inputs: list[ca.SX], response: Response) -> None:
        assert response.margin is not None
        first = self._row(0)
        joints = response.acceleration[first : first + self.layout.joints]
        parts = [ca.densify(part) for part in (response.margin, joints, response.residual)]
        self.verdict = ca.Function("verdict", inputs, parts, {"cse": True})


def _towards(seen: Signals, sign: float) -> Signals:
    """The same signals with all joints sliding in that direction."""
    return replace(seen, direction=ca.SX(np.full(seen.position.shape[0], sign)))
