"""Motion of spherical joints and flexible links, as arrays over time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reference_model.dynamics.tree import Tree, tree_of
from robot_model import InputError, Robot

__all__ = ["InnerMotion", "NodeMotion", "inner_numbers"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class InnerMotion:
    """Inner coordinates, their rates and accelerations; k spherical joints, s modal coordinates.

    Attributes:
        balls: quaternions w, x, y, z of the spherical joints, child to joint axes, shape (N, 4 k).
        ball_rates: angular velocities of child against parent in child axes [rad/s], shape (N, 3 k).
        ball_accelerations: time derivatives of those [rad/s^2], shape (N, 3 k).
        modal, modal_rates, modal_accelerations: of all flexible links in file order [sqrt(kg) m and per s,
            s^2], shape (N, s).
    """

    balls: Array
    ball_rates: Array
    ball_accelerations: Array
    modal: Array
    modal_rates: Array
    modal_accelerations: Array

    @classmethod
    def at_rest(cls, robot: Robot, samples: int = 1) -> InnerMotion:
        """Undeformed links and straight spherical joints."""
        return cls.resting(tree_of(robot), samples)

    @classmethod
    def resting(cls, tree: Tree, samples: int = 1) -> InnerMotion:
        """The same for a tree."""
        k = len(tree.balls)
        still, flat = np.zeros((samples, 3 * k)), np.zeros((samples, tree.modal))
        straight = np.tile([1.0, 0.0, 0.0, 0.0], (samples, k))
        return cls(straight, still, still, flat, flat, flat)

    @property
    def accelerations(self) -> Array:
        """In the order of generalised vectors, shape (N, 3 k + s)."""
        return np.hstack([self.ball_accelerations, self.modal_accelerations])

    def stacked(self) -> Array:
        """balls, ball rates, modal, modal rates, accelerations, shape (N, numbers)."""
        parts = [self.balls, self.ball_rates, self.modal, self.modal_rates, self.accelerations]
        return np.hstack([np.atleast_2d(np.asarray(part, dtype=float)) for part in parts])

    def __len__(self) -> int:
        return len(self.modal)

    def check(self, name: str, tree: Tree) -> None:
        """Raise `InputError` unless every array has the columns that the robot of this name needs."""
        wanted = (4 * len(tree.balls), *[3 * len(tree.balls)] * 2, *[tree.modal] * 3)
        for part, width in zip(self.__dataclass_fields__, wanted):
            shape = np.shape(getattr(self, part))
            if len(shape) != 2 or shape[1] != width:
                raise InputError(
                    f"inner motion: {part} has shape {shape}; robot '{name}' needs (N, {width})."
                )


@dataclass(frozen=True)
class NodeMotion:
    """Motion of a node of a flexible link.

    Attributes:
        position: in the inertial frame [m], shape (N, 3).
        rotation: node axes to inertial axes, shape (N, 3, 3).
        velocity: inertial, in the node's own (deformed) axes [m/s], shape (N, 3).
        acceleration: inertial, in the node's own axes, gravity not in it [m/s^2], shape (N, 3).
        deflection: from the undeformed place, in the link's axes [m], shape (N, 3).
    """

    position: Array
    rotation: Array
    velocity: Array
    acceleration: Array
    deflection: Array


def inner_numbers(tree: Tree) -> tuple[int, ...]:
    """Widths of the parts of `InnerMotion.stacked`."""
    return (4 * len(tree.balls), 3 * len(tree.balls), tree.modal, tree.modal, tree.inner)
