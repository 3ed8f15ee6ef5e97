"""Compiles expressions of a robot and evaluates them over complete recordings."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

from reference_model.codegen.batched import Batched
from reference_model.dynamics.symbolic import Motion, SymbolicRobot
from reference_model.dynamics.tree import Tree
from reference_model.passive.base_motion import BASE_NUMBERS, BaseMotion
from reference_model.passive.inner_motion import InnerMotion, inner_numbers
from robot_model import InputError, Robot

__all__ = ["Build", "Evaluator"]

Array = NDArray[np.float64]
Build = Callable[[SymbolicRobot, ca.SX], list[ca.SX]]


class Evaluator:
    """Checks arrays against a robot and evaluates the results of a `Build`; compiled on first use.

    Args:
        robot: the description.
        tree: of the same robot.
        inertial: default inertial parameters, shape (P,).
    """

    def __init__(self, robot: Robot, tree: Tree, inertial: Array) -> None:
        self.robot, self.tree = robot, tree
        self._inertial = inertial
        self._rest = InnerMotion.resting(tree)
        self._functions: dict[tuple[Build, bool], Batched] = {}

    def __call__(
        self,
        build: Build,
        motion: tuple[ArrayLike, ArrayLike, ArrayLike],
        given: tuple[BaseMotion | None, InnerMotion | None, ArrayLike | None],
        extra: Array | None = None,
        *,
        place: ArrayLike | None = None,
    ) -> tuple[Array, ...]:
        """One array per result of `build`, shape (N, rows).

        Args:
            build: from the robot in its motion and `extra` to its results.
            motion: position, velocity, acceleration of the one-coordinate joints, shape (N, n) or (n,).
            given: the motion of the base and of inner coordinates, the inertial numbers; None for defaults.
            extra: further inputs of `build`, shape (N, rows) or (rows,).
            place: position of the base in the inertial frame [m], shape (N, 3) or (3,).

        Raises:
            InputError: shapes that do not fit, or a free base without its motion.
        """
        base, given_inner, inertial = given
        inner = self._rest if given_inner is None else given_inner
        inner.check(self.robot.name, self.tree)
        if self.tree.free_base and base is None:
            raise InputError(
                f"robot '{self.robot.name}' has a free base: give its motion (`base`); "
                "`reconstruct_base` makes it from the joint motion."
            )
        joints = [np.atleast_2d(np.asarray(column, dtype=float)) for column in motion]
        numbers = self._inertial if inertial is None else np.asarray(inertial, dtype=float)
        where = np.asarray(self.robot.base.position if place is None else place, dtype=float)
        inputs = [
            *joints,
            numbers,
            where,
            np.zeros(0) if base is None else base.stacked(),
            inner.stacked() if len(inner) > 1 else inner.stacked()[0],
            np.zeros(0) if extra is None else extra,
        ]
        self._check(inputs)
        key = (build, base is not None)
        if key not in self._functions:
            self._functions[key] = Batched(self._function(build, base is not None, inputs[-1].shape[-1]))
        return self._functions[key](*inputs)

    def _check(self, inputs: list[Array]) -> None:
        for what, array in zip(("position", "velocity", "acceleration or torque"), inputs):
            if array.ndim != 2 or array.shape[1] != len(self.tree.joints):
                raise InputError(
                    f"{what} has shape {array.shape}; "
                    f"robot '{self.robot.name}' has {len(self.tree.joints)} moving joints."
                )
        lengths = {len(array) for array in inputs if array.ndim == 2}
        if len(lengths) > 1:
            raise InputError(f"arrays of a motion differ in length: {sorted(lengths)}.")
        if inputs[3].shape != self._inertial.shape:
            raise InputError(f"inertial has shape {inputs[3].shape}, not {self._inertial.shape}.")

    def _function(self, build: Build, moving_base: bool, extras: int) -> ca.Function:
        count = len(self.tree.joints)
        q, qd, qdd = (ca.SX.sym(symbol, count) for symbol in ("q", "qd", "qdd"))
        numbers, place = ca.SX.sym("inertial", len(self._inertial)), ca.SX.sym("place", 3)
        base = ca.SX.sym("base", BASE_NUMBERS if moving_base else 0)
        inner = ca.SX.sym("inner", sum(inner_numbers(self.tree)))
        extra = ca.SX.sym("extra", extras)
        fixed: dict[str, Any] = SymbolicRobot.still_base(self.robot)
        if moving_base:
            fixed |= {"attitude": base[:4], "base_velocity": base[4:10], "base_acceleration": base[10:16]}
        parts = ca.vertsplit(inner, np.cumsum([0, *inner_numbers(self.tree)]).tolist())
        names = ("balls", "ball_rates", "modal", "modal_rates", "inner_acceleration")
        fixed |= {"base_position": place, **dict(zip(names, parts))}
        robot = SymbolicRobot(self.robot, Motion(q, qd, qdd, **fixed), numbers, tree=self.tree)
        results = [ca.vec(ca.densify(result)) for result in build(robot, extra)]
        inputs = [q, qd, qdd, numbers, place, base, inner, extra]
        return ca.Function("model", inputs, results, {"cse": True})
