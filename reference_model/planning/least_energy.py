"""The motion between two poses that loses the least energy to viscous friction and to the windings.

Direct collocation (Radau points of order three; Betts, Practical Methods for Optimal Control, 2010, ch. 4):
states at the points of all intervals and torques there are the unknowns of one large program, which IPOPT
solves (Waechter, Biegler, Math. Program. 106 (2006) 25-57). The loss is that of Katoh and others' path
planning for space robots, mechanical viscous friction and the armatures' resistance, with this project's own
dynamics, including a free base and its attitude. Links count as rigid, and effects other than viscous
friction are ignored.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from reference_model.control.motion import reference_function
from reference_model.flexible.undeformed import undeformed
from reference_model.joint.losses import winding_gain
from reference_model.plant.closed_loop import Plant
from reference_model.steppers.integration import integrate
from robot_model import ComputedTorque, InputError, NoController, Quintic, Reference, Robot, Table, nearest

__all__ = ["Planned", "least_energy"]

Array = NDArray[np.float64]

#: Points in every interval.
POINTS = 3
#: Tracking stiffness of the initial guess, in units of the motion's rate.
GUESS_BANDWIDTH = 20.0
#: Of IPOPT.
TOLERANCE, MOST_ITERATIONS = 1e-8, 500


@dataclass(frozen=True)
class Planned:
    """A motion of least energy.

    Attributes:
        robot: the description with that motion as its reference, tables of degree five.
        loss: energy dissipated by viscous friction and windings along it [J].
        quintic: the same along the quintic between the same poses [J].
    """

    robot: Robot
    loss: float
    quintic: float


def least_energy(
    robot: Robot, displacements: Mapping[str, float], *, duration: float, intervals: int = 30
) -> Planned:
    """The motion from rest at the initial pose to rest elsewhere.

    Args:
        robot: the description; its torque limits hold.
        displacements: of joints, by name [rad or m]; others return to where they were.
        duration: of the motion [s]; the recording keeps its length where that is longer.
        intervals: of the collocation.

    Raises:
        InputError: an unknown joint, an unsupported robot, or no solution.
    """
    plan = _planned_robot(robot, displacements, duration)
    gain, viscous = winding_gain(plan), _viscosities(plan)
    plant = Plant(plan.model_copy(update={"controller": NoController()}))
    motors = [joint.actuator for joint in robot.moving_joints]
    limits = np.array([(motor and motor.torque_limit) or np.inf for motor in motors])
    found, quintic = _solve(plan, plant, (gain, viscous, limits), duration, intervals)
    instants = np.linspace(0.0, duration, intervals + 1)
    places = found.states[:: POINTS + 1, plant.layout.rows("position")]
    tables = tuple(
        Table(joint=joint.name, times=tuple(instants.tolist()), positions=tuple(q.tolist()), degree=5)
        for joint, q in zip(plan.moving_joints, places.T)
    )
    given = robot.reference or Reference(duration=duration)
    reference = given.model_copy(update={"joints": tables, "duration": max(duration, given.duration)})
    return Planned(robot.model_copy(update={"reference": reference}), found.loss, quintic)


def _planned_robot(robot: Robot, displacements: Mapping[str, float], duration: float) -> Robot:
    """The rigid robot with viscous friction and a quintic to the goal, tracked."""
    names = [joint.name for joint in robot.moving_joints]
    for name in displacements:
        if name not in names:
            raise InputError(f"robot '{robot.name}': '{name}' is no moving joint{nearest(name, names)}.")
    if robot.spherical_joints:
        raise InputError(
            f"robot '{robot.name}': motions of least energy are planned for joints with one coordinate; its "
            f"joint '{robot.spherical_joints[0].name}' is spherical."
        )
    if duration <= 0:
        raise InputError(f"robot '{robot.name}': a motion of {duration:g} s; give a duration above zero.")
    for joint, gain in zip(robot.moving_joints, winding_gain(robot).full().ravel()):
        if not gain > 0:
            raise InputError(
                f"robot '{robot.name}', joint '{joint.name}': a motion of least energy needs the actuator's "
                "torque_constant and resistance."
            )
    moves = tuple(
        Quintic(joint=name, displacement=far, duration=duration) for name, far in displacements.items()
    )
    rate = GUESS_BANDWIDTH / duration
    free = tuple(
        joint.model_copy(update={"actuator": joint.actuator.model_copy(update={"torque_limit": None})})
        if joint.actuator
        else joint
        for joint in robot.joints
    )
    changes = {
        "joints": tuple(joint.model_copy(update={"clearance": None, "thermal": None}) for joint in free),
        "effects": tuple(use for use in robot.effects if use.effect == "viscous_friction"),
        "controller": ComputedTorque(kp=rate**2, kd=2 * rate),
        "reference": Reference(duration=duration, joints=moves),
    }
    return undeformed(robot.model_copy(update=changes))


def _viscosities(robot: Robot) -> ca.DM:
    """Coefficients of the joints [N m s/rad], n x 1."""
    found = dict.fromkeys((joint.name for joint in robot.moving_joints), 0.0)
    for use in robot.effects:
        found[use.at] += use.parameters["coefficient"]
    return ca.DM(list(found.values()))


@dataclass(frozen=True)
class _Solution:
    """States at interval ends and points, shape (rows, N), and the loss [J]."""

    states: Array
    loss: float


def _solve(
    robot: Robot, plant: Plant, figures: tuple[ca.DM, ca.DM, Array], duration: float, intervals: int
) -> tuple[_Solution, float]:
    """The solution, and the loss of the quintic by the same quadrature.

    Figures are windings' gains, viscosities and torque limits of the joints, (n,) each.
    """
    gain, viscous, limits = figures
    taus = ca.collocation_points(POINTS, "radau")
    slopes, ends, weights = ca.collocation_coeff(taus)
    step, n, size = duration / intervals, plant.layout.joints, plant.layout.size
    shares = [0.0, *taus]
    times = np.array([(k + share) * step for k in range(intervals) for share in shares[:-1]] + [duration])
    guess = integrate(Plant(robot), reference_function(robot), times, hold=0.0, rtol=1e-9, atol=1e-11)
    x, u = ca.SX.sym("x", size), ca.SX.sym("u", n)
    speed = plant.layout.split(x)["velocity"]
    lost = ca.dot(viscous * speed, speed) + ca.dot(gain * u, u)
    rate = plant.rate(0.0, x, ca.SX(n, 1), u)
    model = ca.Function("model", [x, u], [ca.densify(rate), lost], {"cse": True})
    program = _Program()
    first = program.states(guess.states[0], fixed=True)
    total: Any = 0
    quintic = 0.0
    kept = [first]
    for k in range(intervals):
        rows = k * POINTS
        inside = [program.states(guess.states[rows + j + 1]) for j in range(POINTS)]
        torques = [program.torques(guess.commands[rows + j + 1], limits) for j in range(POINTS)]
        derivative = ca.horzcat(first, *inside) @ slopes
        for j in range(POINTS):
            moved, loss = model(inside[j], torques[j])
            program.equal(derivative[:, j] - step * moved)
            total += step * weights[j] * loss
            at = rows + j + 1
            quintic += step * float(weights[j]) * float(model(guess.states[at], guess.commands[at])[1])
        kept += inside
        first = program.states(guess.states[min(rows + POINTS, len(times) - 1)])
        program.equal(ca.horzcat(kept[-POINTS - 1], *inside) @ ends - first)
        kept.append(first)
    goal = reference_function(robot)(duration)[0]
    parts = plant.layout.split(first)
    program.equal(parts["position"] - goal)
    program.equal(parts["velocity"])
    values, loss = program.solved(total, robot)
    states = np.array(ca.Function("kept", [program.column], [ca.horzcat(*kept)])(values)).T
    return _Solution(states, loss), quintic


class _Program:
    """Unknowns, bounds, first guess and equations of the collocation."""

    def __init__(self) -> None:
        self._parts: list[Any] = []
        self._guess: list[Array] = []
        self._bounds: list[tuple[Array, Array]] = []
        self._equations: list[Any] = []

    @property
    def column(self) -> Any:
        """All unknowns."""
        return ca.vertcat(*self._parts)

    def states(self, guess: Array, *, fixed: bool = False) -> Any:
        """States of one instant."""
        far = np.full(len(guess), np.inf)
        return self._unknown(guess, (guess, guess) if fixed else (-far, far))

    def torques(self, guess: Array, limits: Array) -> Any:
        """Torques at one instant."""
        return self._unknown(np.clip(guess, -limits, limits), (-limits, limits))

    def equal(self, expression: Any) -> None:
        """An equation: this is zero."""
        self._equations.append(expression)

    def solved(self, loss: Any, robot: Robot) -> tuple[Array, float]:
        """Values of all unknowns, and the least loss."""
        nlp = {"x": self.column, "f": loss, "g": ca.vertcat(*self._equations)}
        quiet: dict[str, Any] = {"print_level": 0, "sb": "yes", "tol": TOLERANCE, "max_iter": MOST_ITERATIONS}
        options: dict[str, Any] = {"ipopt": quiet, "print_time": False, "expand": True}
        solver = ca.nlpsol("least", "ipopt", nlp, options)
        low, high = (np.concatenate(side) for side in zip(*self._bounds))
        found = solver(x0=np.concatenate(self._guess), lbx=low, ubx=high, lbg=0, ubg=0)
        if not solver.stats()["success"]:
            raise InputError(
                f"robot '{robot.name}': no motion of least energy was found "
                f"({solver.stats()['return_status']}); give it more time, or lift the torque limits."
            )
        return found["x"].full().ravel(), float(found["f"])

    def _unknown(self, guess: Array, bounds: tuple[Array, Array]) -> Any:
        part = ca.MX.sym(f"v{len(self._parts)}", len(guess))
        self._parts.append(part)
        self._guess.append(np.asarray(guess, dtype=float))
        self._bounds.append(bounds)
        return part
