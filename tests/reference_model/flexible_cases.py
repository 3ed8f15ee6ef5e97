"""Random trees with flexible bodies and spherical joints, in random states, for tests of the recursion.

The flexible bodies are not beams but clouds of random nodes with random modes, so that no entry of their
integrals is zero by accident; all constants are sums over the nodes, word by word as in the definitions.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np
from hypothesis import strategies as st
from random_robots import random_mass

from reference_model.dynamics.symbolic import Motion, SymbolicRobot
from reference_model.evaluation.model import RobotModel
from reference_model.flexible import FlexibleBody
from reference_model.kinematics.spatial import quaternion_from_rpy
from reference_model.passive.base_motion import BaseMotion
from reference_model.passive.inner_motion import InnerMotion
from robot_model import Robot

NODES = 4


def tilde(a: np.ndarray) -> np.ndarray:
    return np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])


def cloud(
    rng: np.random.Generator, modes: int, *, free: bool = False, stiffening: bool = False
) -> FlexibleBody:
    """A body of `NODES` random nodes; `free`: its root moves in its frame; stiffening: nodes on one axis."""
    axis = rng.normal(size=3)
    axis /= np.linalg.norm(axis)
    nodes = np.vstack([np.zeros(3), rng.normal(0, 0.5, (NODES - 1, 3))])
    if stiffening:
        nodes = np.linspace(0, 1, NODES)[:, None] * axis
    masses = rng.uniform(0.2, 1, NODES)
    squares = rng.normal(size=(NODES, 3, 3))
    inertias = 0.02 * squares @ squares.transpose(0, 2, 1)
    phi, psi = rng.normal(0, 0.4, (2, NODES, 3, modes))
    if not free:
        phi[0] = psi[0] = 0
    roots = rng.normal(0, 0.2, (NODES, modes, modes))  # small: M is right to second order in x
    roots[0] = 0
    short = np.cumsum(roots @ roots.transpose(0, 2, 1), axis=0)
    stiff, damp = rng.normal(size=(2, modes, modes))
    return FlexibleBody(
        **node_sums(nodes, masses, inertias, phi, psi),
        stiffness=stiff @ stiff.T + 5 * np.eye(modes),
        damping=damp @ damp.T,
        frequencies=np.ones(modes),
        nodes=nodes,
        translations=phi,
        rotations=psi,
        node_masses=masses,
        node_inertias=inertias,
        root=0,
        tip=NODES - 1,
        strain=rng.normal(size=(2, modes)),
        axis=axis if stiffening else None,
        foreshortening=short if stiffening else None,
    )


def node_sums(nodes, masses, inertias, phi, psi) -> dict:
    """Model equations 2.5."""
    modes = range(phi.shape[2])
    every = list(zip(masses, inertias, nodes, phi, psi))
    return {
        "mass": sum(masses),
        "first_moment": masses @ nodes,
        "inertia": sum(J - m * tilde(r) @ tilde(r) for m, J, r, _, _ in every),
        "S0": sum(m * p for m, _, _, p, _ in every),
        "S1": sum(m * tilde(r) @ p + J @ t for m, J, r, p, t in every),
        "P": sum(J @ t for _, J, _, _, t in every),
        "E": np.array([sum(m * tilde(r) @ tilde(p[:, j]) for m, _, r, p, _ in every) for j in modes]),
        "F": np.array(
            [
                [sum(m * tilde(p[:, j]) @ tilde(p[:, k]) for m, _, _, p, _ in every) for k in modes]
                for j in modes
            ]
        ),
        "D": np.array([sum(m * tilde(p[:, j]) @ p for m, _, _, p, _ in every) for j in modes]),
        "h": np.array(
            [[sum(m * np.cross(p[:, k], p[:, j]) for m, _, _, p, _ in every) for j in modes] for k in modes]
        ),
        "modal_mass": sum(m * p.T @ p + t.T @ J @ t for m, J, _, p, t in every),
    }


@dataclass(frozen=True)
class Case:
    """A model with flexible bodies and N states of it; `base` is None for a fixed base."""

    model: RobotModel
    bodies: dict[str, FlexibleBody]
    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    base: BaseMotion | None
    inner: InnerMotion

    @property
    def motion(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return self.position, self.velocity, self.acceleration

    @property
    def given(self) -> dict:
        return {"base": self.base, "inner": self.inner}

    def stacked(self, base: str, joints: np.ndarray, *more: np.ndarray) -> np.ndarray:
        head = []
        if self.base is not None:
            head = [getattr(self.base, f"linear_{base}"), getattr(self.base, f"angular_{base}")]
        return np.hstack([*head, joints, *more])

    @property
    def speed(self) -> np.ndarray:
        inner = self.inner
        return self.stacked("velocity", self.velocity, inner.ball_rates, inner.modal_rates)

    @property
    def generalised_acceleration(self) -> np.ndarray:
        inner = self.inner.accelerations
        return self.stacked("acceleration", self.acceleration, inner)

    def forward(self, force: np.ndarray) -> np.ndarray:
        """Accelerations under generalised forces."""
        offset, count = (0 if self.base is None else 6), len(self.model.joints)
        return self.model.forward_dynamics(
            self.position,
            self.velocity,
            force[:, offset : offset + count],
            **self.given,
            base_wrench=force[:, :6] if offset else None,
            inner_force=force[:, offset + count :],
        )


def random_tree(seed: int, *, base: str, kinds: list[str], modes: list[int], gravity: bool = True) -> Robot:
    """One link per joint kind; link k has modes[k] modes, none being rigid. Links hang on random others."""
    rng = np.random.default_rng(seed)
    bodies = random_bodies(seed, modes)
    joints, links = [], []
    for k, (kind, count) in enumerate(zip(kinds, modes)):
        flexible = {"modal": {"file": "none.npz", "modes": count}} if count else random_mass(rng)
        links.append({"name": f"link{k}", **flexible})
        parent = (["base"] + [link["name"] for link in links[:k]])[rng.integers(max(0, k - 1), k + 1)]
        origin = rng.normal(0, 0.4, 3)
        if parent in bodies:
            origin = bodies[parent].nodes[rng.integers(1, NODES)]
        joint = {
            "name": f"joint{k}",
            "kind": kind,
            "parent": parent,
            "child": f"link{k}",
            "origin": tuple(origin.tolist()),
            "rpy": tuple(rng.uniform(-3, 3, 3).tolist()),
            "axis": tuple(rng.normal(size=3).tolist()),
        }
        if kind in ("revolute", "prismatic"):
            joint["actuator"] = {"gear_ratio": 10.0, "rotor_inertia": float(rng.uniform(0, 0.01))}
        joints.append(joint)
    order = rng.permutation(len(joints))
    return Robot.model_validate(
        {
            "name": "random",
            "gravity": tuple(rng.normal(0, 5, 3).tolist()) if gravity else (0.0, 0.0, 0.0),
            "base": {"kind": base, **random_mass(rng), "rpy": tuple(rng.uniform(-1, 1, 3).tolist())},
            "links": links,
            "joints": [joints[k] for k in order],
        }
    )


def random_bodies(seed: int, modes: list[int]) -> dict[str, FlexibleBody]:
    """Every third one has a moving root, every third one stiffens."""
    found = {}
    for k, count in enumerate(modes):
        if count:
            rng = np.random.default_rng([seed, k])
            found[f"link{k}"] = cloud(rng, count, free=(seed + k) % 3 == 0, stiffening=(seed + k) % 3 == 1)
    return found


def random_flexible_case(seed: int, *, samples: int = 3, **tree) -> Case:
    robot = random_tree(seed, **tree)
    bodies = random_bodies(seed, tree["modes"])
    rng = np.random.default_rng([seed, 99])
    model = RobotModel(robot, bodies=bodies)
    balls = len(robot.spherical_joints)
    base = None
    if model.free_base:
        base = BaseMotion(rng.normal(size=(samples, 4)), *rng.normal(size=(4, samples, 3)))
    inner = InnerMotion(
        rng.normal(size=(samples, 4 * balls)),
        *rng.normal(size=(2, samples, 3 * balls)),
        0.3 * rng.normal(size=(samples, model.tree.modal)),  # rotations of nodes by tenths of a radian
        *rng.normal(size=(2, samples, model.tree.modal)),
    )
    return Case(model, bodies, *rng.normal(size=(3, samples, len(model.joints))), base, inner)


@st.composite
def trees(draw: st.DrawFn, *, base: tuple[str, ...] = ("fixed", "free"), gravity: bool = True) -> Case:
    count = draw(st.integers(1, 4))
    kind = st.sampled_from(["revolute", "revolute", "prismatic", "spherical", "fixed"])
    kinds = draw(st.lists(kind, min_size=count, max_size=count))
    modes = draw(st.lists(st.sampled_from([0, 1, 2, 3]), min_size=count, max_size=count))
    seed = draw(st.integers(0, 2**31 - 1))
    return random_flexible_case(
        seed, base=draw(st.sampled_from(base)), kinds=kinds, modes=modes, gravity=gravity
    )


@dataclass(frozen=True)
class Symbols:
    """A robot in symbols, and how its coordinates change with time under given accelerations."""

    robot: SymbolicRobot
    motion: Motion
    inputs: tuple[ca.SX, ...]
    base_position: tuple[float, float, float] = (0.3, -0.2, 0.5)

    def rate(self, expression: ca.SX) -> ca.SX:
        """Exact time derivative of an expression of the state."""
        m = self.motion
        turn = self.robot.mechanism.states[0].rotation
        omega, linear = m.base_velocity[3:], m.base_velocity[:3]
        apparent = ca.vertcat(ca.cross(omega, linear), ca.SX(3, 1))
        changes = [
            (m.position, m.velocity),
            (m.velocity, m.acceleration),
            (m.base_position, turn @ linear),
            (m.attitude, quaternion_rate(m.attitude, omega)),
            (m.base_velocity, m.base_acceleration - apparent),
            (m.ball_rates, m.inner_acceleration[: m.ball_rates.shape[0]]),
            (m.modal, m.modal_rates),
            (m.modal_rates, m.inner_acceleration[m.ball_rates.shape[0] :]),
        ]
        quads, speeds = ca.vertsplit(m.balls, 4), ca.vertsplit(m.ball_rates, 3)
        turned = [quaternion_rate(q, w) for q, w in zip(quads, speeds)] if m.balls.shape[0] else []
        changes.append((m.balls, ca.vertcat(ca.SX(0, 1), *turned)))
        total = ca.SX(*expression.shape)
        for symbol, change in changes:
            if symbol.shape[0]:
                total += ca.jtimes(expression, symbol, ca.densify(change))
        return total

    def values(self, case: Case, *expressions: ca.SX) -> list[np.ndarray]:
        """Expressions in the first state of a case."""
        inner, base = case.inner, case.base
        base = base or BaseMotion.at_rest(quaternion_from_rpy(case.model.robot.base.rpy))
        numbers = [array[0] for array in case.motion]
        columns = base.stacked()[0]
        numbers += [columns[:4], columns[4:10], columns[10:], np.array(self.base_position)]
        numbers += [inner.balls[0], inner.ball_rates[0], inner.modal[0], inner.modal_rates[0]]
        numbers.append(inner.accelerations[0])
        function = ca.Function("values", list(self.inputs), [ca.densify(item) for item in expressions])
        found = function.call([ca.DM(number) for number in numbers])
        return [item.full() for item in found]


def quaternion_rate(q: ca.SX, omega: ca.SX) -> ca.SX:
    w, v = q[0], q[1:4]
    return ca.vertcat(-ca.dot(omega, v), w * omega - ca.cross(omega, v)) / 2


def symbols_of(case: Case, *, gravity: bool = True) -> Symbols:
    tree = case.model.tree
    n, k, s = len(tree.joints), len(tree.balls), tree.modal
    sizes = (n, n, n, 4, 6, 6, 3, 4 * k, 3 * k, s, s, tree.inner)
    inputs = tuple(ca.SX.sym(f"u{k}", size) for k, size in enumerate(sizes))
    motion = Motion(*inputs)
    numbers = case.model.inertial.copy()
    if not gravity:
        numbers[-3:] = 0
    robot = SymbolicRobot(case.model.robot, motion, ca.SX(numbers), tree=tree)
    return Symbols(robot, motion, inputs)
