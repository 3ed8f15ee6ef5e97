"""MuJoCo over a motion without control."""

from __future__ import annotations

from typing import Any

import mujoco
import mujoco.rollout
import numpy as np

from benchmarks.speed.rigid_peers import mjcf
from benchmarks.work_precision.manoeuvres import SAMPLES, Case, Course

__all__ = ["MujocoRun"]


class MujocoRun:
    """One model and its initial state.

    Args:
        case: without control; its friction is viscous.
        steps: of the whole motion, a multiple of `SAMPLES`.
    """

    def __init__(self, case: Case, steps: int) -> None:
        robot = case.robot
        self._case, self._steps = case, steps
        self._model: Any = mujoco.MjModel.from_xml_string(mjcf(robot))
        self._model.opt.timestep = case.duration / steps
        self._model.opt.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_DAMPER)
        self._model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
        self._joints = [self._model.joint(joint.name) for joint in robot.moving_joints]
        for use in robot.effects:
            assert use.effect == "viscous_friction"
            self._model.dof_damping[self._model.joint(use.at).dofadr] += use.parameters["coefficient"]
        self._data = mujoco.MjData(self._model)
        for joint, place in zip(robot.moving_joints, self._joints):
            self._data.qpos[place.qposadr] = joint.initial_position
            self._data.qvel[place.dofadr] = joint.initial_velocity
        kind = mujoco.mjtState.mjSTATE_FULLPHYSICS
        self._start = np.empty(mujoco.mj_stateSize(self._model, kind))
        mujoco.mj_getState(self._model, self._data, self._start, kind)

    def __call__(self) -> None:
        """All steps, in C++."""
        found, _ = mujoco.rollout.rollout(self._model, self._data, self._start[None], nstep=self._steps)
        self._states = np.vstack([self._start, found[0]])

    def course(self) -> Course:
        every = self._steps // SAMPLES
        rows = self._states[::every]
        qpos = rows[:, 1 : 1 + self._model.nq]  # after the time
        columns = [qpos[:, [int(place.qposadr[0]) for place in self._joints]]]
        if self._case.robot.base.kind == "free":
            columns += [qpos[:, :3], qpos[:, 3:7]]
        return Course(self._case.instants, np.hstack(columns))
