"""The radial basis network of an adaptive controller; see `robot_model.AdaptiveNetwork`."""

from __future__ import annotations

import casadi as ca
import numpy as np

from reference_model.control.motion import reference_function
from robot_model import AdaptiveNetwork, Robot

__all__ = ["Network", "network_of"]

#: Smallest range of a reference, whose half scales the network's inputs [rad or m, or per s].
LEAST_RANGE = 1e-3


class Network:
    """phi(x) of positions and velocities, and the rates of the weights.

    Attributes:
        centres: number of them; each joint has as many weights.
    """

    def __init__(self, robot: Robot, controller: AdaptiveNetwork) -> None:
        assert robot.reference is not None
        self._controller, self.centres = controller, controller.centres
        reference = reference_function(robot)
        instants = np.linspace(0.0, robot.reference.duration, controller.centres)
        dense = np.linspace(0.0, robot.reference.duration, 1001)
        along = reference.map(len(dense))(dense[None])
        course = np.vstack([along[0].full(), along[1].full()])
        low, high = course.min(axis=1), course.max(axis=1)
        self._middle, self._half = (low + high) / 2, np.maximum(high - low, LEAST_RANGE) / 2
        found = reference.map(len(instants))(instants[None])
        points = np.vstack([found[0].full(), found[1].full()])
        self._points = (points - self._middle[:, None]) / self._half[:, None]

    def basis(self, position: ca.SX, velocity: ca.SX) -> ca.SX:
        """phi, centres x 1."""
        x = (ca.vertcat(position, velocity) - self._middle) / self._half
        spread = 2 * self._controller.width**2
        return ca.vertcat(*(ca.exp(-ca.sumsqr(x - ca.DM(c)) / spread) for c in self._points.T))

    def output(self, weights: ca.SX, basis: ca.SX) -> ca.SX:
        """W^T phi [rad/s^2 or m/s^2], n x 1; `weights` joint by joint, n centres x 1."""
        return ca.reshape(weights, self.centres, -1).T @ basis

    def rates(self, weights: ca.SX, basis: ca.SX, surface: ca.SX) -> ca.SX:
        """dW/dt of the weights, in their order; `surface` is s of every joint, n x 1."""
        given = self._controller
        driven = ca.vertcat(*(basis * surface[k] for k in range(surface.shape[0])))
        return given.adaptation * (driven - given.leakage * weights)


def network_of(robot: Robot) -> Network | None:
    """The network of the robot's controller, where it has one."""
    controller = robot.controller
    return Network(robot, controller) if isinstance(controller, AdaptiveNetwork) else None
