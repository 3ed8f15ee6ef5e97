"""Sliding mode, and computed torque with an adaptive radial basis network."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from exudyn_model.control.base import ControlLaw, Goal, JointState
from exudyn_model.control.full_dynamics import FullDynamics
from exudyn_model.control.gains import gains
from exudyn_model.control.nominal import Nominal
from robot_model import AdaptiveNetwork, Robot, SlidingMode

__all__ = ["AdaptiveNetworkLaw", "SlidingModeLaw"]

Array = NDArray[np.float64]
#: Smallest range of a network input, whose half scales it [rad or m, or per s].
LEAST_RANGE = 1e-3


class _Nominal(ControlLaw):
    """Nominal inverse dynamics at the law's own accelerations."""

    def __init__(self, robot: Robot, nominal: Nominal, sample_time: float) -> None:
        super().__init__(robot, sample_time=sample_time)
        self.bent_links = nominal.bent_links
        self.stiff = bool(robot.flexible_links) and not self.bent_links
        self.needs_inner = isinstance(nominal, FullDynamics)
        self._nominal = nominal

    @abstractmethod
    def _wanted(self, state: JointState, goals: Sequence[Goal]) -> list[float]:
        """Accelerations of the joints."""

    def output(self, state: JointState, integral: Sequence[float]) -> list[float]:
        wanted = self._wanted(state, self.goals(state.time))
        return self._nominal(state.position, state.velocity, wanted, base=state.base, inner=state.inner)


class SlidingModeLaw(_Nominal):
    """s = ed + slope e, and rdd + slope ed + rate sat(s/layer) [+ proportional s]."""

    def __init__(self, robot: Robot, nominal: Nominal) -> None:
        settings = robot.controller
        assert isinstance(settings, SlidingMode)
        super().__init__(robot, nominal, settings.sample_time)
        self.stiff = True  # a thin layer is a large gain
        linear = settings.reaching == "exponential"
        self._gains = list(
            zip(
                gains(robot, settings.slope),
                gains(robot, settings.rate),
                gains(robot, settings.boundary_layer),
                gains(robot, settings.proportional) if linear else [0.0] * len(self._motions),
            )
        )

    def _wanted(self, state: JointState, goals: Sequence[Goal]) -> list[float]:
        found = []
        rows = zip(self._gains, goals, state.position, state.velocity)
        for (slope, rate, layer, proportional), (r, rd, rdd), q, qd in rows:
            ed = rd - qd
            s = ed + slope * (r - q)
            found.append(rdd + slope * ed + rate * max(-1.0, min(1.0, s / layer)) + proportional * s)
        return found


class AdaptiveNetworkLaw(_Nominal):
    """rdd + kd ed + kp e + W^T phi, dW/dt = adaptation (phi s - leakage W), s = ed + (kd/2) e.

    The weights are integrated by Heun's rule: trial instants use a prediction from the last accepted one.
    While an output is held, so is s, which follows the torques in the output.
    """

    remembers = True

    def __init__(self, robot: Robot, nominal: Nominal) -> None:
        settings = robot.controller
        assert isinstance(settings, AdaptiveNetwork)
        super().__init__(robot, nominal, settings.sample_time)
        self._gains = list(zip(gains(robot, settings.kp), gains(robot, settings.kd)))
        self._adaptation, self._leakage = settings.adaptation, settings.leakage
        self._spread = 2 * settings.width**2
        count = len(self._motions)
        self._weights, self._rates = np.zeros((count, settings.centres)), np.zeros((count, settings.centres))
        self._time = 0.0
        assert robot.reference is not None
        course = self._along(np.linspace(0.0, robot.reference.duration, 1001))
        low, high = course.min(axis=0), course.max(axis=0)
        self._middle, self._half = (low + high) / 2, np.maximum(high - low, LEAST_RANGE) / 2
        places = self._along(np.linspace(0.0, robot.reference.duration, settings.centres))
        self._centres = (places - self._middle) / self._half

    def output(self, state: JointState, integral: Sequence[float]) -> list[float]:
        return [*super().output(state, integral), *self._surface(state)]

    def torque(self, output: Sequence[float], state: JointState) -> list[float]:
        return list(output[: len(self._motions)])

    def recall(self, time: float, weights: Array) -> None:
        """Continue from these weights at an instant [s], shape (joints, centres)."""
        self._time, self._weights = time, np.array(weights, dtype=float)
        self._rates = np.zeros_like(self._weights)

    @property
    def rates(self) -> Array:
        """Of the weights at the last accepted instant, shape (joints, centres)."""
        return self._rates

    def begin(self, state: JointState, output: Sequence[float]) -> None:
        self._time, self._rates = state.time, self._slope(state, output, self._weights)

    def accept(self, state: JointState, output: Sequence[float]) -> None:
        step = state.time - self._time
        predicted = self._weights + step * self._rates
        later = self._slope(state, output, predicted)
        self._weights = self._weights + step * (self._rates + later) / 2
        self.begin(state, output)

    def _wanted(self, state: JointState, goals: Sequence[Goal]) -> list[float]:
        weights = self._weights + (state.time - self._time) * self._rates
        learnt = weights @ self._basis(state)
        rows = zip(self._gains, goals, state.position, state.velocity, learnt.tolist())
        return [rdd + kd * (rd - qd) + kp * (r - q) + a for (kp, kd), (r, rd, rdd), q, qd, a in rows]

    def _surface(self, state: JointState) -> list[float]:
        rows = zip(self._gains, self.goals(state.time), state.position, state.velocity)
        return [rd - qd + kd / 2 * (r - q) for (_, kd), (r, rd, _), q, qd in rows]

    def _slope(self, state: JointState, output: Sequence[float], weights: Array) -> Array:
        driven = np.outer(output[-len(self._motions) :], self._basis(state))
        return self._adaptation * (driven - self._leakage * weights)

    def _basis(self, state: JointState) -> Array:
        x = (np.array([*state.position, *state.velocity]) - self._middle) / self._half
        found: Array = np.exp(-((self._centres - x) ** 2).sum(axis=1) / self._spread)
        return found

    def _along(self, instants: Array) -> Array:
        """Positions and then velocities of the reference, shape (N, 2 n)."""
        goals = [[motion(t) for motion in self._motions] for t in instants.tolist()]
        table = np.array(goals).reshape(len(goals), len(self._motions), 3)
        return np.concatenate([table[:, :, 0], table[:, :, 1]], axis=1)
