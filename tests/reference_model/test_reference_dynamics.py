"""Identities of rigid dynamics on random trees in random states."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from random_robots import Case, cases, random_case, random_robot

from reference_model.passive.base_motion import BaseMotion
from robot_model import InputError

#: Sums of some hundred products of order one to a hundred, in double precision: 1e-13 was seen at worst.
ROUNDING = 1e-10

pytestmark = pytest.mark.fuzz
few = settings(max_examples=settings.default.max_examples // 3, derandomize=True)


def close(value: np.ndarray, wanted: np.ndarray, tolerance: float = ROUNDING) -> None:
    scale = 1 + np.max(np.abs(wanted), initial=0.0)
    assert np.max(np.abs(value - wanted), initial=0.0) <= tolerance * scale


def unaccelerated(base: BaseMotion | None) -> BaseMotion | None:
    if base is None:
        return None
    zero = np.zeros((len(base), 3))
    return replace(base, angular_acceleration=zero, linear_acceleration=zero)


@few
@given(cases())
def test_forward_dynamics_inverts_inverse_dynamics(case: Case) -> None:
    force = case.model.inverse_dynamics(*case.motion, base=case.base)
    offset = case.model.rows - len(case.model.joints)
    found = case.model.forward_dynamics(
        case.position,
        case.velocity,
        force[:, offset:],
        base=case.base,
        base_wrench=force[:, :6] if offset else None,
    )
    close(found, case.generalised_acceleration)


@few
@given(cases())
def test_mass_matrix_is_the_force_of_unit_accelerations_and_positive_definite(case: Case) -> None:
    model = case.model
    matrix = model.mass_matrix(case.position, base=case.base)
    still = model.inverse_dynamics(
        case.position, case.velocity, 0 * case.acceleration, base=unaccelerated(case.base)
    )
    offset = model.rows - len(model.joints)
    for column in range(model.rows):
        unit = np.zeros((len(still), model.rows))
        unit[:, column] = 1.0
        base = case.base
        if base is not None:
            base = replace(base, linear_acceleration=unit[:, :3], angular_acceleration=unit[:, 3:6])
        force = model.inverse_dynamics(case.position, case.velocity, unit[:, offset:], base=base)
        close(matrix[:, :, column], force - still)
    close(matrix, matrix.transpose(0, 2, 1), 1e-15)
    assert np.linalg.eigvalsh(matrix).min() > 0


@few
@given(cases())
def test_articulated_bodies_agree_with_solving_the_mass_matrix(case: Case) -> None:
    model = case.model
    matrix = model.mass_matrix(case.position, base=case.base)
    still = model.inverse_dynamics(
        case.position, case.velocity, 0 * case.acceleration, base=unaccelerated(case.base)
    )
    torque = np.random.default_rng(0).normal(size=case.position.shape)
    force = np.hstack([np.zeros((len(torque), model.rows - torque.shape[1])), torque])
    wanted = np.linalg.solve(matrix, (force - still)[:, :, None])[:, :, 0]
    # the condition number of Z multiplies rounding
    found = model.forward_dynamics(case.position, case.velocity, torque, base=case.base)
    close(found, wanted, ROUNDING * np.linalg.cond(matrix).max())


@few
@given(cases())
def test_regressor_times_parameters_is_inverse_dynamics(case: Case) -> None:
    model = case.model
    regressor = model.regressor(*case.motion, base=case.base)
    force = model.inverse_dynamics(*case.motion, base=case.base)
    gravity = np.array([name.startswith("gravity") for name in model.inertial_names])
    close(regressor[:, :, ~gravity] @ model.inertial[~gravity], force)
    # linear in gravity at given masses: its columns carry the difference to weightlessness
    weightless = np.where(gravity, 0.0, model.inertial)
    without = model.inverse_dynamics(*case.motion, base=case.base, inertial=weightless)
    close(regressor[:, :, gravity] @ model.inertial[gravity], force - without)


@few
@given(cases())
def test_motion_jacobians_agree_with_differences(case: Case) -> None:
    model, step = case.model, 1e-5
    found = model.motion_jacobians(*case.motion, base=case.base)
    for which, jacobian in enumerate(found):
        for column in range(len(model.joints)):
            ends = []
            for sign in (1, -1):
                motion = [array.copy() for array in case.motion]
                motion[which][:, column] += sign * step
                ends.append(model.inverse_dynamics(*motion, base=case.base))
            # central differences: truncation 1e-10 and rounding 1e-14/1e-5, both times derivatives below 1e3
            close(jacobian[:, :, column], (ends[0] - ends[1]) / (2 * step), 1e-6)


@few
@given(cases())
def test_moment_along_the_axis_is_the_joint_torque(case: Case) -> None:
    model = case.model
    force, moment = model.joint_wrenches(*case.motion, base=case.base)
    torque = model.inverse_dynamics(*case.motion, base=case.base)[:, model.rows - len(model.joints) :]
    reflected = model.inertial[-3 - len(model.joints) : -3]
    for k, joint in enumerate(model.robot.moving_joints):
        along = (force if joint.kind == "prismatic" else moment)[:, k] @ joint.unit_axis
        close(along + reflected[k] * case.acceleration[:, k], torque[:, k])


@few
@given(cases())
def test_bearing_loads_are_the_wrench_without_axis_components(case: Case) -> None:
    model = case.model
    loads = model.bearing_loads(*case.motion, base=case.base)
    forces, moments = model.joint_wrenches(*case.motion, base=case.base)
    for k, joint in enumerate(model.robot.moving_joints):
        axis, force, moment = joint.unit_axis, forces[:, k], moments[:, k]
        sliding = joint.kind == "prismatic"
        close(loads[:, k, 0], np.linalg.norm(np.cross(force, axis), axis=1), 1e-10)
        close(loads[:, k, 1], 0 * force[:, 0] if sliding else np.abs(force @ axis), 1e-10)
        bending = moment if sliding else np.cross(moment, axis)
        close(loads[:, k, 2], np.linalg.norm(bending, axis=1), 1e-10)


@few
@given(cases(base=("free",)))
def test_base_balance(case: Case) -> None:
    """M_0 vd_0 - f_0 = base wrench - reactions of the joints on it, moments about the base's origin."""
    model, base = case.model, case.base
    assert base is not None
    need = model.inverse_dynamics(*case.motion, base=base)[:, :6]
    body = model.robot.base
    com, omega = np.array(body.center_of_mass), base.angular_velocity
    acceleration = (
        base.linear_acceleration
        + np.cross(base.angular_acceleration, com)
        + np.cross(omega, np.cross(omega, com))
    )
    gravity = _to_base(base.attitude, np.array(model.robot.gravity))
    own = body.mass * (acceleration - gravity)
    inertia = body.inertia_matrix
    spin = base.angular_acceleration @ inertia + np.cross(omega, omega @ inertia)
    wanted = np.hstack([own, spin + np.cross(com, own)])
    # a base alone, with the links' masses taken away, needs just that
    names = model.inertial_names
    alone = np.where([name.startswith(("base.", "gravity")) for name in names], model.inertial, 0.0)
    close(model.inverse_dynamics(*case.motion, base=base, inertial=alone)[:, :6], wanted)
    others = np.where([name.startswith("base.") for name in names], 0.0, model.inertial)
    close(need - model.inverse_dynamics(*case.motion, base=base, inertial=others)[:, :6], wanted)


def _to_base(attitude: np.ndarray, vector: np.ndarray) -> np.ndarray:
    q = attitude / np.linalg.norm(attitude, axis=1, keepdims=True)
    w, v = q[:, :1], -q[:, 1:]
    return vector + 2 * np.cross(v, np.cross(v, vector) + w * vector)


@few
@given(cases())
def test_kinetic_energy_from_the_mass_matrix(case: Case) -> None:
    model = case.model
    weightless = model.inertial.copy()
    weightless[-3:] = 0
    energy = model.energy(case.position, case.velocity, base=case.base, inertial=weightless)
    speed = case.velocity
    if case.base is not None:
        speed = np.hstack([case.base.linear_velocity, case.base.angular_velocity, speed])
    matrix = model.mass_matrix(case.position, base=case.base)
    close(energy, np.einsum("ni,nij,nj->n", speed, matrix, speed) / 2)


@few
@given(cases(base=("free",)))
def test_momentum_is_the_base_rows_of_the_mass_matrix(case: Case) -> None:
    model, base = case.model, case.base
    assert base is not None
    speed = np.hstack([base.linear_velocity, base.angular_velocity, case.velocity])
    rows = np.einsum("nij,nj->ni", model.mass_matrix(case.position, base=base)[:, :6], speed)
    linear, _ = model.momentum(case.position, case.velocity, base=base)
    close(_to_base(base.attitude, linear), rows[:, :3])


def test_a_moved_fixed_base_has_the_reactions_of_a_free_one() -> None:
    free = random_case(random_robot(3, base="free", kinds=["revolute", "prismatic", "revolute"]), 4)
    fixed = random_case(random_robot(3, base="fixed", kinds=["revolute", "prismatic", "revolute"]), 4)
    wanted = free.model.inverse_dynamics(*free.motion, base=free.base)[:, 6:]
    close(fixed.model.inverse_dynamics(*free.motion, base=free.base), wanted)


def test_a_heavy_free_base_converges_to_a_fixed_base() -> None:
    kinds = ["revolute", "revolute", "prismatic"]
    fixed = random_case(random_robot(5, base="fixed", kinds=kinds, gravity=False), 6)
    free = random_robot(5, base="free", kinds=kinds, gravity=False)
    heavy = free.model_copy(
        update={
            "base": free.base.model_copy(
                update={"mass": 1e12, "center_of_mass": (0.0, 0.0, 0.0), "inertia": (1e12, 1e12, 1e12)}
            )
        }
    )
    case = random_case(heavy, 6)
    base = BaseMotion.at_rest(np.array([1.0, 0, 0, 0]), len(case.position))
    torque = case.acceleration
    found = case.model.forward_dynamics(case.position, case.velocity, torque, base=base)[:, 6:]
    # the base's share falls as the ratio of masses, 1e-12 times a hundred or so
    close(found, fixed.model.forward_dynamics(case.position, case.velocity, torque), 1e-9)


def test_arrays_longer_than_a_block_are_evaluated_completely() -> None:
    case = random_case(random_robot(7, base="free", kinds=["revolute", "revolute"]), 8, samples=600)
    whole = case.model.inverse_dynamics(*case.motion, base=case.base)
    assert case.base is not None
    for k in (0, 255, 256, 511, 512, 599):
        one = BaseMotion.from_stacked(case.base.stacked()[k : k + 1])
        np.testing.assert_array_equal(
            case.model.inverse_dynamics(*(array[k] for array in case.motion), base=one)[0], whole[k]
        )


def test_unusable_arguments_are_refused() -> None:
    case = random_case(random_robot(1, base="free", kinds=["revolute"]), 2)
    with pytest.raises(InputError, match="free base"):
        case.model.inverse_dynamics(*case.motion)
    with pytest.raises(InputError, match="moving joints"):
        case.model.inverse_dynamics(np.zeros((4, 2)), case.velocity, case.acceleration, base=case.base)
    with pytest.raises(InputError, match="length"):
        case.model.inverse_dynamics(case.position[:2], case.velocity, case.acceleration, base=case.base)
    with pytest.raises(InputError, match="inertial"):
        case.model.inverse_dynamics(*case.motion, base=case.base, inertial=[1.0])
    with pytest.raises(InputError, match="shape"):
        BaseMotion(np.zeros((2, 4)), *np.zeros((4, 3, 3)))
