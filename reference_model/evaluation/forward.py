"""Forward dynamics one state at a time, for loops in Python: compiled, and without copies."""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from reference_model.codegen.batched import InPlace
from reference_model.codegen.compiled import compiled
from reference_model.dynamics.symbolic import Motion, SymbolicRobot
from reference_model.dynamics.tree import tree_of
from reference_model.evaluation.model import RobotModel
from robot_model import InputError, Robot

__all__ = ["ForwardDynamics", "forward_function"]


class ForwardDynamics:
    """Accelerations of a robot in one state after another.

    Args:
        robot: of rigid links on joints with one coordinate; effects are left out.

    Attributes:
        position: of a free base the attitude (quaternion w, x, y, z), then the joints [rad or m], to be
            written into, shape (4 + n,) or (n,).
        velocity: of a free base [linear; angular] in base axes, then the joints, shape (6 + n,) or (n,).
        force: on the joints [N m or N], shape (n,).
        acceleration: result of `evaluate`, base first, shape (6 + n,) or (n,); overwritten every time.
        evaluate: reads the first three and fills the last.
        note: how it runs, and if not as compiled code, why.

    Raises:
        InputError: the robot has flexible links or spherical joints.
    """

    def __init__(self, robot: Robot) -> None:
        if robot.flexible_links or robot.spherical_joints:
            names = [*(link.name for link in robot.flexible_links), *(j.name for j in robot.spherical_joints)]
            raise InputError(
                f"robot '{robot.name}': forward dynamics one state at a time is for rigid links on joints "
                f"with one coordinate, and '{names[0]}' is neither; use `RobotModel.forward_dynamics`."
            )
        code = compiled([_packed(robot)])
        self._own, self.note = InPlace(code.functions[0]), code.note
        self.position, self.velocity, self.force = self._own.inputs
        self.acceleration: NDArray[np.float64] = self._own.outputs[0][:, 0]
        self.evaluate = self._own.evaluate


def forward_function(robot: Robot, *, constants: bool = True) -> ca.Function:
    """(attitude, base velocity, q, qd, torque, inertial numbers) -> accelerations, without effects.

    Args:
        robot: of rigid links on joints with one coordinate.
        constants: the masses are those of the description, and the last input is empty.
    """
    numbers, count = RobotModel(robot).inertial, len(robot.moving_joints)
    attitude, base = ca.SX.sym("a", 4), ca.SX.sym("b", 6)
    q, qd, torque = (ca.SX.sym(name, count) for name in ("q", "qd", "u"))
    given = ca.SX.sym("m", 0 if constants else len(numbers))
    fixed = SymbolicRobot.still_base(robot)
    free = robot.base.kind == "free"
    if free:
        fixed |= {"attitude": attitude, "base_velocity": base}
    masses = ca.sparsify(ca.SX(numbers)) if constants else given
    symbolic = SymbolicRobot(robot, Motion(q, qd, ca.SX(count, 1), **fixed), masses, tree=tree_of(robot))
    result = ca.densify(symbolic.forward_dynamics(ca.vertcat(ca.SX(6 if free else 0, 1), torque)))
    inputs = [attitude, base, q, qd, torque, given]
    return ca.Function("forward_dynamics", inputs, [result], {"cse": True})


def _packed(robot: Robot) -> ca.Function:
    """(position, velocity, force) -> accelerations, rows as in `ForwardDynamics`."""
    count, free = len(robot.moving_joints), robot.base.kind == "free"
    head, rates = (4, 6) if free else (0, 0)
    position, velocity = ca.SX.sym("p", head + count), ca.SX.sym("v", rates + count)
    force = ca.SX.sym("f", count)
    attitude = position[:4] if free else ca.SX(4, 1)
    base = velocity[:6] if free else ca.SX(6, 1)
    given = [attitude, base, position[head:], velocity[rates:], force, ca.SX(0, 1)]
    result = forward_function(robot).call(given, True, False)
    return ca.Function("forward_packed", [position, velocity, force], result, {"cse": True})
