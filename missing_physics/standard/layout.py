"""The parameters of the standard model, their starting values and scales."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from missing_physics.bodies.pseudo_inertia import COUNT, sizes, solid
from missing_physics.standard.rows import FRICTION, Rows, held_scale
from reference_model.dynamics.inertial import body_names
from reference_model.evaluation.model import RobotModel
from reference_model.flexible.beam_numbers import POSITIVE
from robot_model import Robot

__all__ = ["Information", "Layout", "bodies_of", "is_known", "length_of"]

Array = NDArray[np.float64]

#: A body lighter than this fraction of the robot is an auxiliary frame without mass.
MASSLESS = 1e-9
#: Starting value of a non-negative parameter, as a fraction of its scale: inside the feasible set.
START = 1e-3


@dataclass(frozen=True, eq=False)
class Information:
    """Information on parameters from channels outside the rows, as a quadratic log-likelihood.

    Attributes:
        names: of the parameters.
        matrix, vector: the log-likelihood is vector.x - x.matrix.x / 2, shapes (Q, Q) and (Q,).
        is_off: whether it prefers bodies other than the robot file's.
    """

    names: tuple[str, ...]
    matrix: Array
    vector: Array
    is_off: bool


@dataclass(frozen=True)
class Layout:
    """Which parameters are estimated: indices in the vector x = [inertial parameters; joints' friction].

    Attributes:
        names: of all parameters.
        start: starting values, shape (X,): the nominal ones, with bodies made physically consistent.
        free: whether a parameter is estimated, shape (X,).
        bodies: indices of the ten parameters of each estimated body.
        gaussian: indices of the estimated parameters with a Gaussian prior: rotors and friction.
        positive: those of `gaussian` that are not negative.
        size: scale of each parameter, shape (X,): its value if it alone caused the recorded torque.
        centre, width: of the Gaussian prior of each parameter, shape (X,): zero and `size`.
        beams: indices of the estimated parameters of beams, which are positive.
        scale: derivative of the bodies' common scale, which is one at the file's values, by all parameters,
            shape (X,); zero where torques determine it.
        extra: information on the parameters from other channels; None without any.
    """

    names: tuple[str, ...]
    start: Array
    free: NDArray[np.bool_]
    bodies: tuple[slice, ...]
    gaussian: NDArray[np.int_]
    positive: NDArray[np.int_]
    size: Array
    centre: Array
    width: Array
    scale: Array
    beams: NDArray[np.int_]
    extra: Information | None = None

    @cached_property
    def extra_places(self) -> NDArray[np.int_]:
        """Indices of the parameters of `extra`, shape (Q,)."""
        return np.array(
            [self.names.index(name) for name in self.extra.names] if self.extra else [], dtype=int
        )

    @classmethod
    def of(cls, model: RobotModel, nominal: Array, rows: Sequence[Rows]) -> Layout:
        """Layout for a robot and these recordings; parameters of joints that never slide are fixed."""
        robot, count = model.robot, len(model.inertial_names)
        kinds = [f"{joint}.{kind}" for joint in model.joints for kind in FRICTION]
        names = (*model.inertial_names, *kinds)
        start = np.concatenate([nominal, np.zeros(len(kinds))])
        bodies = bodies_of(robot, nominal)
        for body, place in bodies.items():
            start[place] = solid(nominal[place], length_of(robot, body))
        slides = np.any([r.counted.any(axis=0) for r in rows], axis=0)
        size = np.ones(len(names))
        for place in bodies.values():
            size[place] = sizes(start[place])
        free = np.zeros(len(names), dtype=bool)
        for place in bodies.values():
            free[place] = [not is_known(robot, name) for name in names[place]]
        rotors = COUNT * len(body_names(robot))
        moved = np.any([r.measured.any(axis=0) for r in rows], axis=0)
        driven = np.array(_driven(robot)) & moved
        torque = _rms([r.scale for r in rows])
        rotor_columns = _rms(
            [r.inertial[:, :, rotors : rotors + torque.size].diagonal(axis1=1, axis2=2) for r in rows]
        )
        speed = _rms([r.friction[:, :, 0] for r in rows])
        for k, name in enumerate(model.joints):
            own = slice(count + k * len(FRICTION), count + (k + 1) * len(FRICTION))
            size[rotors + k] = torque[k] / rotor_columns[k]
            size[own] = torque[k] / speed[k], torque[k], torque[k]
            free[own] = slides[k]
            free[rotors + k] = slides[k] and driven[k] and not is_known(robot, f"{name}.reflected_inertia")
        beams = np.flatnonzero([name.split(".")[-1] in POSITIVE for name in names])
        size[beams] = np.where(start[beams] > 0.0, start[beams], 1.0)
        free[beams] = [start[i] > 0.0 and not is_known(robot, names[i]) for i in beams]
        signed = np.array([name.endswith(".offset") for name in names])
        jointwise = np.array(
            [not any(p.start <= i < p.stop for p in bodies.values()) for i in range(len(names))]
        )
        jointwise[beams] = False
        positive = np.flatnonzero(free & jointwise & ~signed)
        start[positive] = np.maximum(start[positive], START * size[positive])
        estimated = np.flatnonzero(free & jointwise)
        scale = np.zeros_like(size)
        if not moved.any():
            affecting = np.any([r.inertial.any(axis=(0, 1)) for r in rows], axis=0)[:-3]
            scale[: affecting.size] = held_scale(affecting, nominal[:-3], len(body_names(robot)))
        places, centre, beams = tuple(bodies.values()), np.zeros_like(size), beams[free[beams]]
        return cls(names, start, free, places, estimated, positive, size, centre, size, scale, beams)


def bodies_of(robot: Robot, nominal: Array) -> dict[str, slice]:
    """Indices of the ten parameters of each body with mass, among inertial parameters of shape (P,)."""
    total = sum(link.mass for link in robot.links)
    places = {name: slice(COUNT * b, COUNT * (b + 1)) for b, name in enumerate(body_names(robot))}
    return {name: place for name, place in places.items() if nominal[place.start] > MASSLESS * total}


def _rms(parts: Sequence[Array]) -> Array:
    """Scale of each column; never zero."""
    found = np.sqrt(np.mean(np.concatenate(parts) ** 2, axis=0))  # passive joints: all zero
    return np.asarray(np.maximum(found, max(1e-9 * float(found.max()), 1e-12)))


def is_known(robot: Robot, name: str) -> bool:
    """Whether the robot file declares a parameter, or its body or joint, as exact."""
    return name in robot.known or name.split(".")[0] in robot.known


def _driven(robot: Robot) -> list[bool]:
    """Whether each moving joint may have a rotor; all may if the file has no actuator at all."""
    actuators = [joint.actuator is not None for joint in robot.drives]
    return actuators if any(actuators) else [True] * len(actuators)


def length_of(robot: Robot, body: str) -> float:
    """Length of a body: to its centre of mass or the farthest joint that it carries [m]."""
    member = robot.base if body == "base" else robot.link(body)
    reach = [float(np.linalg.norm(joint.origin)) for joint in robot.joints if joint.parent == body]
    return max([*reach, float(np.linalg.norm(member.center_of_mass)), 1e-2])
