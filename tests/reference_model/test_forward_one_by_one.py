"""Forward dynamics one state at a time: agreement with array evaluation, and arguments read in place."""

from __future__ import annotations

import gc

import numpy as np
import pytest
from random_robots import random_case, random_robot

from reference_model.codegen.batched import InPlace, Single
from reference_model.evaluation.forward import ForwardDynamics, forward_function
from robot_model import InputError, load_robot

KINDS = ["revolute", "prismatic", "revolute"]


@pytest.mark.parametrize("base", ["fixed", "free"])
def test_it_agrees_with_the_array_evaluation(base: str) -> None:
    robot = random_robot(2, base=base, kinds=KINDS)
    case, own = random_case(robot, 7), ForwardDynamics(robot)
    rows = case.model.forward_dynamics(case.position, case.velocity, case.acceleration, base=case.base)
    for k, expected in enumerate(rows):
        if case.base is None:
            own.position[:], own.velocity[:] = case.position[k], case.velocity[k]
        else:
            own.position[:] = [*case.base.attitude[k], *case.position[k]]
            twist = [*case.base.linear_velocity[k], *case.base.angular_velocity[k]]
            own.velocity[:] = [*twist, *case.velocity[k]]
        own.force[:] = case.acceleration[k]
        own.evaluate()
        assert np.allclose(own.acceleration, expected, rtol=1e-10, atol=1e-10)


def test_evaluate_reuses_one_array_and_only_single_copies() -> None:
    function = forward_function(random_robot(3, base="fixed", kinds=KINDS))
    own, copied = InPlace(function), Single(function)
    before = own.outputs[0]
    own.inputs[4][:] = 1.0
    own.evaluate()
    assert own.outputs[0] is before
    assert np.any(before != 0)
    first = copied(*own.inputs)[0]
    assert np.array_equal(first, before)
    assert copied(*own.inputs)[0] is not first


def test_evaluate_keeps_its_arrays_alive() -> None:
    own = ForwardDynamics(random_robot(2, base="fixed", kinds=KINDS))
    evaluate, force, acceleration = own.evaluate, own.force, own.acceleration
    del own
    gc.collect()
    force[:] = 1.0
    evaluate()
    assert np.isfinite(acceleration).all()
    assert np.any(acceleration != 0)


def test_flexible_links_are_refused_by_name() -> None:
    with pytest.raises(InputError, match="'link2' is neither"):
        ForwardDynamics(load_robot("flexible_space_robot"))
