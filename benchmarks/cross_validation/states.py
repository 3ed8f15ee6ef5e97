"""A robot at one instant, in plain numbers, converted to the state of each engine.

Neither engine uses the other's code: this module uses both and converts states, no physics.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from exudyn_model.bodies.flexible_link import flexible_link
from exudyn_model.control.laws import JointState, control_law
from exudyn_model.control.nominal import nominal_model
from exudyn_model.control.nonlinear import AdaptiveNetworkLaw
from exudyn_model.control.rigid_dynamics import BaseState, Inner
from exudyn_model.effects import effects_of
from exudyn_model.effects.drives import ActuatorLag
from exudyn_model.effects.friction import LuGreFriction
from exudyn_model.equations import Posture, equations
from exudyn_model.forces.joints import Forces
from reference_model.control.motion import reference_function
from reference_model.dynamics.balance import LOADS
from reference_model.evaluation.model import RobotModel
from reference_model.passive.base_motion import BaseMotion
from reference_model.passive.inner_motion import InnerMotion
from reference_model.plant.closed_loop import Plant
from robot_model import AdaptiveNetwork, Robot, VoltageServo

__all__ = ["State", "of_exudyn", "of_reference", "random_states"]

Array = NDArray[np.float64]

#: Iterations of loads and friction, and the relative change that ends them.
PASSES, SETTLED = 200, 1e-15
#: Steps for rates by differences: the longest [s], and their number, each half as long as the one before.
LONGEST, LEVELS = 8e-6, 5
#: Effects at joints with one memory value, with the law of the twin.
REMEMBERING = {"lugre_friction": LuGreFriction, "actuator_lag": ActuatorLag}


@dataclass(frozen=True)
class State:
    """One instant; vectors of joints in the order of the file.

    Attributes:
        time: [s].
        position, velocity: of the joints with one coordinate, shape (n,).
        turn, place, twist: attitude (3, 3), position (3,) and linear and angular velocity in base axes (6,).
        balls, ball_rates: attitudes of spherical joints (k, 3, 3), and angular velocities (3 k,).
        modal, modal_rates: modal coordinates (s,).
        remembered: bristle or lag of effects at joints, by (effect, joint).
        integral: of reference minus position, shape (n,).
        weights: of an adaptive controller's network, shape (n, centres).
    """

    time: float
    position: Array
    velocity: Array
    turn: Array
    place: Array
    twist: Array
    balls: Array
    ball_rates: Array
    modal: Array
    modal_rates: Array
    remembered: Mapping[tuple[str, str], float]
    integral: Array
    weights: Array

    @property
    def quaternion(self) -> Array:
        """Attitude of the base (w, x, y, z)."""
        return _quaternion(self.turn)


def random_states(robot: Robot, count: int, *, seed: int = 1) -> Iterator[State]:
    """States with joint speeds of all sizes, 1e-5 to 2 rad/s, either way; links bent by some centimetres."""
    chance = np.random.default_rng([seed, len(robot.name)])
    n, k = len(robot.moving_joints), len(robot.spherical_joints)
    s = sum(flexible_link(link).count for link in robot.flexible_links)
    centres = robot.controller.centres if isinstance(robot.controller, AdaptiveNetwork) else 0
    for _ in range(count):
        speed = 10 ** chance.uniform(-5, 0.3, n) * chance.choice([-1.0, 1.0], n)
        kept = {
            (item.effect, item.at): float(chance.normal(0, 0.5 if item.effect == "actuator_lag" else 1e-3))
            for item in robot.effects
            if item.effect in REMEMBERING
        }
        yield State(
            time=float(chance.uniform(0.01, 0.2)),
            position=chance.normal(size=n),
            velocity=speed,
            turn=Rotation.from_rotvec(chance.normal(size=3)).as_matrix(),
            place=chance.normal(size=3),
            twist=chance.normal(size=6),
            balls=Rotation.from_rotvec(chance.normal(size=(k, 3))).as_matrix() if k else np.zeros((0, 3, 3)),
            ball_rates=chance.normal(size=3 * k),
            modal=0.02 * chance.normal(size=s),
            modal_rates=0.3 * chance.normal(size=s),
            remembered=kept,
            integral=0.01 * chance.normal(size=n),
            weights=chance.normal(size=(n, centres)),
        )


def of_reference(robot: Robot, states: list[State]) -> list[dict[str, Array]]:
    """Quantities of the reference model at each state; see `of_exudyn`."""
    plant, model, reference = Plant(robot), RobotModel(_bare(robot)), reference_function(robot)
    n = len(robot.moving_joints)
    found = []
    for state in states:
        column = _column(plant, robot, state)
        goal = reference(state.time)
        command = plant.command(state.time, column, *goal)
        values = plant.watch(state.time, column, goal[0], command)
        watched = {name: value.full().ravel() for name, value in zip(Plant.WATCHED, values)}
        rates = plant.rate(state.time, column, goal[0], command).full().ravel()
        base, inner = _base_motion(robot, state), _inner_motion(state)
        mass, forces = model.minimal_form(state.position, state.velocity, base=base, inner=inner)
        recursion = model.mass_matrix(state.position, base=base, inner=inner)
        loads = watched["loads"].reshape(n, len(LOADS))
        given = {
            "mass matrix": mass[0],
            "mass matrix, recursive": recursion[0],
            "gyroscopic, elastic and gravity forces": forces[0],
            "control torque": watched["torque"],
            "friction torque": watched["friction"],
            "accelerations": watched["acceleration"],
            "bearing loads": loads[:, :3].ravel(),
            "reference motion": np.concatenate([column.full().ravel() for column in goal]),
        }
        if plant.wrench:
            given["control wrench on the base"] = command.full().ravel()[:6]
        if isinstance(robot.controller, VoltageServo):
            given["control voltage"] = command.full().ravel()
        if state.remembered:
            given["rates of bristles and lags"] = plant.layout.split(rates)["effects"]
        if state.weights.size:
            given["rates of the network's weights"] = plant.layout.split(rates)["weights"]
        found.append(given)
    return found


def of_exudyn(robot: Robot, states: list[State], *, formulation: str = "redundant") -> list[dict[str, Array]]:
    """The same from Exudyn: its mass matrix, forces and constraint forces, and the twin's laws.

    Load-dependent friction and Exudyn's constraint forces are made consistent by alternating iteration.
    """
    found = []
    for state in states:
        posture = _posture(robot, state)
        bare = equations(_bare(robot), posture, formulation=formulation)  # type: ignore[arg-type]
        whole = equations(robot, posture, formulation=formulation)  # type: ignore[arg-type]
        nominal = nominal_model(robot)
        law = control_law(robot, nominal)
        if isinstance(law, AdaptiveNetworkLaw):
            law.recall(state.time, state.weights)
        effects = effects_of(robot)
        forces = Forces(robot, law, effects.laws, at_motors=effects.at_motors)
        loads, given = np.zeros(len(robot.moving_joints)), None
        for _ in range(PASSES):
            now = _joint_state(robot, state, loads.tolist())
            given = forces.resume(now, remembered=_memories(forces, robot, state), integral=state.integral)
            tau = _spread(robot, len(whole.mass), given.total, given.wrench)
            if formulation == "tree" or not forces.needs_loads:
                break
            carried = whole.loads(tau)
            new = np.array(
                [
                    carried[joint.name].friction_moment(joint.bearing) if joint.bearing else 0.0
                    for joint in robot.moving_joints
                ]
            )
            settled = np.abs(new - loads).max() <= SETTLED * np.abs(new).max()
            loads = new
            if settled:
                break
        assert given is not None
        item = {
            "mass matrix": bare.mass,
            "mass matrix, recursive": bare.mass,
            "gyroscopic, elastic and gravity forces": bare.forces,
            "control torque": np.array(given.command),
            "friction torque": np.array(given.friction),
            "accelerations": whole.accelerations(tau),
            "reference motion": np.array(law.goals(state.time)).T.ravel(),
        }
        if formulation != "tree":
            carried = whole.loads(tau)
            item["bearing loads"] = np.ravel([carried[joint.name].sizes for joint in robot.moving_joints])
        if given.wrench:
            item["control wrench on the base"] = np.array(given.wrench)
        if (voltage := forces.voltage(now)) is not None:
            item["control voltage"] = np.array(voltage)
        if state.remembered:
            item["rates of bristles and lags"] = _rates(forces, robot, state, now, given.command)
        if isinstance(law, AdaptiveNetworkLaw):
            item["rates of the network's weights"] = law.rates.ravel()
        found.append(item)
    return found


def _quaternion(turn: Array) -> Array:
    x, y, z, w = Rotation.from_matrix(turn).as_quat()
    return np.array([w, x, y, z])


def _bare(robot: Robot) -> Robot:
    return robot.model_copy(update={"effects": ()})


def _column(plant: Plant, robot: Robot, state: State) -> Array:
    """The state of the reference's plant."""
    column = np.zeros(plant.layout.size)
    parts = plant.layout.split(column)
    parts["position"][:], parts["velocity"][:] = state.position, state.velocity
    if plant.layout.free_base:
        parts["base_position"][:], parts["attitude"][:] = state.place, state.quaternion
        parts["base_velocity"][:] = state.twist
    parts["balls"][:] = np.ravel([_quaternion(turn) for turn in state.balls])
    parts["ball_rates"][:] = state.ball_rates
    parts["modal"][:], parts["modal_rates"][:] = state.modal, state.modal_rates
    kept = [state.remembered[item.effect, item.at] for item in robot.effects if item.effect in REMEMBERING]
    parts["effects"][:] = kept
    if plant.layout.integral:
        parts["integral"][:] = state.integral
    parts["weights"][:] = state.weights.ravel()
    return column


def _base_motion(robot: Robot, state: State) -> BaseMotion | None:
    if robot.base.kind == "fixed":
        return None
    still = np.zeros(3)
    return BaseMotion(state.quaternion, state.twist[3:], state.twist[:3], still, still)


def _inner_motion(state: State) -> InnerMotion:
    balls = np.ravel([_quaternion(turn) for turn in state.balls])
    rows = (balls, state.ball_rates, 0 * state.ball_rates, state.modal, state.modal_rates, 0 * state.modal)
    return InnerMotion(*(np.atleast_2d(row) for row in rows))


def _posture(robot: Robot, state: State) -> Posture:
    free = robot.base.kind == "free"
    return Posture(
        state.position,
        state.velocity,
        base_rotation=state.turn if free else None,
        base_velocity=state.twist if free else None,
        balls=list(state.balls),
        ball_rates=state.ball_rates,
        modal=state.modal,
        modal_rates=state.modal_rates,
    )


def _joint_state(robot: Robot, state: State, loads: list[float]) -> JointState:
    base = None
    if robot.base.kind == "free":
        base = BaseState(state.turn, state.twist[3:], state.place, state.turn @ state.twist[:3])
    known = slice(None if nominal_model(robot).bent_links else 0)
    inner = Inner(list(state.balls), state.ball_rates, state.modal[known], state.modal_rates[known])
    return JointState(state.time, state.position.tolist(), state.velocity.tolist(), base, loads, inner=inner)


def _memories(forces: Forces, robot: Robot, state: State) -> list[list[tuple[float, ...]]]:
    """Memory of every law of every joint."""
    effect = {kind: name for name, kind in REMEMBERING.items()}
    return [
        [
            (state.remembered[effect[type(law)], joint.name],) if type(law) in effect else ()  # type: ignore
            for law in own
        ]
        for joint, own in zip(robot.moving_joints, forces.laws)
    ]


def _spread(robot: Robot, rows: int, joints: list[float], wrench: list[float]) -> Array:
    """Generalised forces of forces on joints and of a wrench on the base."""
    tau, first = np.zeros(rows), 6 if robot.base.kind == "free" else 0
    tau[first : first + len(joints)] = joints
    tau[: len(wrench)] = wrench
    return tau


def _rates(forces: Forces, robot: Robot, state: State, now: JointState, command: list[float]) -> Array:
    """Rates of the laws' memories, from their advance over two short steps at a constant state."""
    found = []
    for item in robot.effects:
        if item.effect not in REMEMBERING:
            continue
        k = [joint.name for joint in robot.moving_joints].index(item.at)
        law = next(law for law in forces.laws[k] if isinstance(law, REMEMBERING[item.effect]))
        z = state.remembered[item.effect, item.at]
        found.append(_rate(law, z, now, k, command[k]))
    return np.array(found)


def _rate(law: LuGreFriction | ActuatorLag, z: float, now: JointState, k: int, command: float) -> float:
    from exudyn_model.effects.base import Instant

    def moved(step: float) -> float:
        load = now.loads[k]
        instant = Instant(
            now.time,
            step,
            now.position[k],
            now.velocity[k],
            command,
            0.0,
            now.velocity[k],
            command,
            load,
            load,
        )
        return (law.advance(instant, (z,))[1][0] - z) / step

    # Means over falling steps h, extrapolated to none (Neville): relaxation exp(-r h) leaves (r h)^5 of it
    # with r up to 1e5 1/s, rounding 1e-16 z / (h zd).
    steps = [LONGEST / 2**k for k in range(LEVELS)]
    means = [moved(step) for step in steps]
    for level in range(1, LEVELS):
        means = [fine + (fine - coarse) / (2**level - 1) for coarse, fine in pairwise(means)]
    return means[0]
