"""User-defined forces act like the same forces in the description."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from exudyn_model import ArmInstant, ExtraForce, measured, simulate
from exudyn_model.effects.base import Memory
from robot_model import EffectUse, Robot, load_robot


class Spring(ExtraForce):
    """T = 3 - 40 q on the only joint."""

    def advance(self, now: ArmInstant, memory: Memory) -> tuple[Sequence[float], Memory]:
        return [3.0 - 40.0 * now.position[0]], memory


class Counter(ExtraForce):
    """Remembers the time that has passed in accepted steps."""

    def initial(self, now: ArmInstant) -> Memory:
        return (0.0,)

    def advance(self, now: ArmInstant, memory: Memory) -> tuple[Sequence[float], Memory]:
        assert abs(memory[0] + now.step - now.time) < 1e-9
        return [0.0], (memory[0] + now.step,)


def short(robot: Robot) -> Robot:
    assert robot.reference is not None
    reference = robot.reference.model_copy(update={"duration": 1.0, "sample_rate": 200.0})
    return robot.model_copy(update={"reference": reference})


def test_a_user_defined_spring_equals_the_spring_effect() -> None:
    robot = short(load_robot("single_axis"))
    use = {"effect": "cable_spring", "at": "joint1", "stiffness": 40.0, "torque_at_zero": 3.0}
    inside = simulate(robot.with_effects(EffectUse.model_validate(use)), sensors=False)
    outside = simulate(robot, sensors=False, extra=[Spring()])
    without = simulate(robot, sensors=False)
    # The same sums in another order.
    assert np.allclose(inside["joint1.torque"], outside["joint1.torque"], atol=1e-6)
    assert np.abs(without["joint1.torque"] - outside["joint1.torque"]).max() > 1.0


def test_memory_follows_accepted_steps() -> None:
    simulate(short(load_robot("single_axis")), sensors=False, extra=[Counter()])


def test_measuring_an_exact_recording_equals_simulating_with_sensors() -> None:
    robot = short(load_robot("single_axis"))
    direct, after = simulate(robot, seed=4), measured(robot, simulate(robot, sensors=False), seed=4)
    assert all(np.array_equal(direct[name], after[name]) for name in direct)
