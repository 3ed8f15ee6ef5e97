"""The regression problem: contributions against closed forms, weights, blocks, noise."""

from __future__ import annotations

import numpy as np
import pytest
from diagnosis_cases import ARM, AXIS, Array, Sines, bare, problem_of, recorded, term

from missing_physics.diagnosis.least_squares.problem import Problem
from missing_physics.diagnosis.preparation.setup import inertial_basis, make_segments
from reference_model.effects.base import SensorEffect
from reference_model.evaluation.model import RobotModel
from robot_model import Recording, robot_from_toml

#: Without the rows near the ends, where the filters still feel that there is no past or no future.
INNER = slice(20, -20)
AXIS_ROBOT, ARM_ROBOT = bare("single_axis"), bare("two_link_arm")


@pytest.fixture(scope="module")
def axis() -> Problem:
    return problem_of(AXIS_ROBOT, recorded(AXIS_ROBOT, AXIS))


@pytest.fixture(scope="module")
def arm() -> Problem:
    return problem_of(ARM_ROBOT, recorded(ARM_ROBOT, ARM))


def reduced(problem: Problem, values: Array) -> Array:
    return problem.segments[0].motion.low_pass.reduce(values)


def state(problem: Problem, motions: tuple[Sines, ...]) -> tuple[Array, ...]:
    time = problem.segments[0].motion.time
    return tuple(np.column_stack(parts) for parts in zip(*(motion(time) for motion in motions)))


def test_nothing_is_left_when_the_robot_is_right(arm: Problem) -> None:
    # the motion's smoother and spline are right to 1e-7 of a torque of 60 N m
    assert np.abs(arm.residual[INNER]).max() < 1e-4
    # and the ends feel the filter's start by a thousandth
    assert np.abs(arm.residual).max() < 1e-3 * np.abs(arm.measured).max()
    assert arm.residual.shape == arm.nuisance.shape[:2] == (arm.time.size, 2)


@pytest.mark.parametrize(
    ("effect", "parameters", "closed_form"),
    [
        ("viscous_friction", {"coefficient": 150.0}, lambda q, qd, qdd: 150.0 * qd),
        ("torque_offset", {"torque": 7.0}, lambda q, qd, qdd: -7.0 + 0 * q),
        (
            "cable_spring",
            {"stiffness": 90.0, "torque_at_zero": 4.0},
            lambda q, qd, qdd: 90.0 * q - 4.0,
        ),
        ("torque_gain", {"gain_error": 0.1}, lambda q, qd, qdd: -0.1 * 95.0 * qdd),
    ],
)
def test_a_linear_joint_effect_is_its_formula_through_the_filter(
    axis: Problem, effect: str, parameters: dict[str, float], closed_form: object
) -> None:
    added = term(effect, "joint1", **parameters)
    q, qd, qdd = state(axis, AXIS)
    value, jacobian = axis.evaluate([added])
    wanted = closed_form(q, qd, qdd)  # type: ignore[operator]
    # smoothed velocity against exact: 1e-6 relative, far from the ends
    np.testing.assert_allclose(value[INNER], reduced(axis, wanted)[INNER], atol=1e-6 * np.abs(wanted).max())
    np.testing.assert_allclose(jacobian @ added.values, value, rtol=1e-12, atol=1e-12)


def test_a_payload_is_the_change_of_inverse_dynamics(arm: Problem) -> None:
    """A point mass at x on link 2, against the inverse dynamics of an arm that carries it as a link."""
    mass, x = 0.7, 0.4
    link = ARM_ROBOT.link("link2")
    total = link.mass + mass
    centre = (link.mass * link.center_of_mass[0] + mass * x) / total
    spread = link.mass * (link.center_of_mass[0] - centre) ** 2 + mass * (x - centre) ** 2
    ixx, iyy, izz = link.inertia
    heavier = link.model_copy(
        update={
            "mass": total,
            "center_of_mass": (centre, 0.0, 0.0),
            "inertia": (ixx, iyy + spread, izz + spread),
        }
    )
    loaded = ARM_ROBOT.model_copy(update={"links": (ARM_ROBOT.link("link1"), heavier)})
    motion = state(arm, ARM)
    change = RobotModel(loaded).inverse_dynamics(*motion) - RobotModel(ARM_ROBOT).inverse_dynamics(*motion)
    value, _ = arm.evaluate([term("payload", "link2", mass=mass, x=x, y=0.0, z=0.0)])
    np.testing.assert_allclose(value[INNER], reduced(arm, change)[INNER], atol=1e-4)


def test_tilted_gravity_is_the_change_of_inverse_dynamics(arm: Problem) -> None:
    gx, _, gz = ARM_ROBOT.gravity
    tilted = ARM_ROBOT.model_copy(update={"gravity": (gx + 0.3, 0.0, gz)})
    motion = state(arm, ARM)
    change = RobotModel(tilted).inverse_dynamics(*motion) - RobotModel(ARM_ROBOT).inverse_dynamics(*motion)
    value, _ = arm.evaluate([term("gravity", "base", x=0.3, y=0.0, z=0.0)])
    np.testing.assert_allclose(value[INNER], reduced(arm, change)[INNER], atol=1e-4)


def test_contributions_add_up_side_by_side(arm: Problem) -> None:
    one = term("viscous_friction", "joint1", coefficient=2.0)
    two = term("cable_spring", "joint2", stiffness=3.0, torque_at_zero=0.5)
    both, jacobian = arm.evaluate([one, two])
    np.testing.assert_allclose(both, arm.evaluate([one])[0] + arm.evaluate([two])[0], atol=1e-12)
    assert jacobian.shape == (arm.time.size, 2, 3)
    assert not both[:, 0].any() or not jacobian[:, 0, 1:].any()
    assert not arm.evaluate([])[0].any()


@pytest.mark.parametrize("joint", [0, 1])
def test_a_sensor_delay_is_a_shifted_position_to_first_order(joint: int) -> None:
    """Halving the delay quarters what first order leaves, which is a small part of the whole."""
    left = []
    for delay in (8e-3, 4e-3):
        shift = np.eye(2)[joint] * delay
        problem = problem_of(ARM_ROBOT, recorded(ARM_ROBOT, ARM, shift=shift))
        value, _ = problem.evaluate([term("sensor_delay", f"joint{joint + 1}.position", delay=delay)])
        whole = np.abs(problem.residual[INNER]).max()
        left.append(np.abs(problem.residual - value)[INNER].max())
        # second order over first: delay times the highest rate of the motion, 2 pi 1.1 Hz
        assert left[-1] < 2 * np.pi * 1.1 * delay * whole
    assert 3.5 < left[0] / left[1] < 4.5


def test_a_sensor_offset_is_a_moved_joint_to_first_order() -> None:
    made = recorded(ARM_ROBOT, ARM)
    left = []
    for offset in (0.02, 0.01):
        moved = made.with_channels({"joint2.position": made["joint2.position"] + offset})
        problem = problem_of(ARM_ROBOT, moved)
        value, _ = problem.evaluate([term("sensor_offset", "joint2.position", offset=offset)])
        left.append(np.abs(problem.residual - value)[INNER].max())
        # second order over first: the offset itself, times the sines' ratio of at most 3
        assert left[-1] < 3 * offset * np.abs(problem.residual[INNER]).max()
    assert 3.5 < left[0] / left[1] < 4.5


@pytest.mark.parametrize(
    ("effect", "values"),
    [
        ("sensor_gain", {"gain_error": 0.08}),
        ("sensor_offset", {"offset": 0.7}),
        ("sensor_delay", {"delay": 0.012}),
        ("clock_drift", {"rate": 3e-3}),
    ],
)
def test_an_error_of_a_torque_sensor_is_what_it_added(effect: str, values: dict[str, float]) -> None:
    """The largest that a challenge draws; not only to first order, of which the square would remain."""
    made = recorded(ARM_ROBOT, ARM)
    channel = "joint1.torque"
    entry = term(effect, channel, **values)
    assert isinstance(entry.effect, SensorEffect)
    wrong = entry.effect.apply(made.time, made[channel], values)
    problem = problem_of(ARM_ROBOT, made.with_channels({channel: wrong}))
    value, jacobian = problem.evaluate([entry])
    left = np.abs(problem.residual - value)[INNER]
    # two rounds leave the cube of a gain beside it, 5e-4; the first order would leave 8 %
    assert left.max() < 2e-3 * np.abs(problem.residual[INNER, 0]).max()
    step = 1e-4 * next(iter(values.values()))
    up, down = (
        problem.evaluate([term(effect, channel, **{k: v + s for k, v in values.items()})])[0]
        for s in (step, -step)
    )
    slope = (up - down) / (2 * step)
    # of a gain e the exact slope is 1/(1 + e) of the one that is used
    assert np.abs(jacobian[:, :, 0] - slope)[INNER].max() < 0.1 * np.abs(slope).max()


def smooth_step(s: Array) -> Array:
    s = np.clip(s, 0.0, 1.0)
    return s**3 * (10 - 15 * s + 6 * s**2)


def test_weights_leave_out_reversals_and_rests() -> None:
    """0-4 s: three swings; 4-7 s: rest; 7-10 s: one way. Reversals at 0.5, 1.5, 2.5, 3.5 s."""
    time = np.arange(2500) / 250.0
    swing = 0.05 * np.sin(np.pi * time) * (time < 4.0)
    q = 0.2 + swing + 0.1 * smooth_step((time - 7.0) / 3.0)
    made = Recording(time, {"joint1.position": q, "joint1.torque": np.sin(time)})
    problem = problem_of(AXIS_ROBOT, made, cutoff=10.0)
    sliding, moving, now = problem.sliding[:, 0], problem.moving[:, 0], problem.time

    def at(instant: float) -> int:
        return int(np.argmin(np.abs(now - instant)))

    assert set(np.unique(sliding)) == set(np.unique(moving)) == {0.0, 1.0}
    for reversal in (1.5, 2.5, 3.5):
        assert sliding[at(reversal)] == 0
        assert moving[at(reversal)] == 1
        # the filter remembers about half a period of its cut-off, 0.05 s
        assert sliding[at(reversal - 0.04)] == 0
        assert sliding[at(reversal + 0.4)] == 1
    assert not sliding[(now > 4.3) & (now < 7.0)].any()
    assert not moving[(now > 4.3) & (now < 7.0)].any()
    assert sliding[at(8.5)] == moving[at(8.5)] == 1
    assert np.all(sliding <= moving)


def test_blocks_are_stretches_of_one_recording() -> None:
    first = recorded(AXIS_ROBOT, AXIS, duration=12.0)
    second = recorded(AXIS_ROBOT, AXIS, duration=6.0, start=3.0)
    problem = problem_of(AXIS_ROBOT, first, second)
    assert np.all(np.diff(problem.blocks) >= 0)
    assert set(np.unique(problem.blocks)) == set(range(problem.blocks.max() + 1))
    for block in np.unique(problem.blocks):
        own = problem.blocks == block
        assert np.unique(problem.segment_of[own]).size == 1
    lengths = [np.ptp(problem.time[problem.blocks == b]) for b in np.unique(problem.blocks)]
    assert max(lengths) < 1.5 * min(lengths)


def test_the_noise_floor_is_what_noise_leaves() -> None:
    robot = bare("two_link_arm", noise=True)
    problem = problem_of(robot, recorded(robot, ARM, duration=20.0, seed=1))
    left = np.sqrt(np.mean(problem.residual**2, axis=0))
    # 20 s at about 10 Hz hold some hundred independent samples: 1/sqrt(2 * 200) = 5 %.
    np.testing.assert_allclose(left, problem.noise_floor, rtol=0.2)


def test_nuisance_columns_follow_a_change_of_the_mass() -> None:
    robot = AXIS_ROBOT.model_copy(update={"links": (AXIS_ROBOT.links[0].model_copy(update={"mass": 100.0}),)})
    problem = problem_of(robot, recorded(AXIS_ROBOT, AXIS))
    column = problem.nuisance[:, 0, 0]
    # the true mass is 95: the residual is -5 % of what 100 kg need, and parallel to the one column
    assert problem.nuisance.shape[2] == 1
    residual = problem.residual[INNER, 0]
    left = residual - column[INNER] * (column[INNER] @ residual) / (column[INNER] @ column[INNER])
    assert np.abs(left).max() < 1e-4 * np.abs(residual).max()
    np.testing.assert_allclose(residual, -5.0 / 95.0 * problem.measured[INNER, 0], atol=1e-4)


def test_a_motor_that_is_described_by_its_inertia_alone() -> None:
    """No mass in the whole robot: the inertia that it is known by is what its numbers are measured by."""
    robot = robot_from_toml("""
        name = "rotor"
        [[links]]
        name = "rotor"
        inertia = [1e-4, 1e-4, 1e-4]
        [[joints]]
        name = "joint1"
        parent = "base"
        child = "rotor"
        axis = [0.0, 0.0, 1.0]
    """)
    segments = make_segments(robot, [recorded(robot, ARM[:1], lambda t, q, qd, qdd: 5e-5 * qdd)])
    basis = inertial_basis(robot, segments)
    assert (basis.scale > 0).all()
    determined = [name for i, name in enumerate(basis.names) if basis.identifiable(i, basis.most)]
    assert determined == ["rotor.inertia.zz"]


def test_a_joint_without_torque_is_not_usable() -> None:
    made = recorded(ARM_ROBOT, ARM)
    channels = {k: v for k, v in made.channels.items() if k != "joint2.torque"}
    problem = problem_of(ARM_ROBOT, Recording(made.time, channels))
    np.testing.assert_array_equal(problem.usable, [True, False])


def test_nothing_is_estimated_again_where_every_inertial_number_is_known() -> None:
    names = [part.name for part in (*ARM_ROBOT.links, *ARM_ROBOT.joints)]
    known = ARM_ROBOT.model_copy(update={"known": (*names, "base")})
    problem = problem_of(known, recorded(known, ARM))
    assert problem.nuisance.shape == (*problem.residual.shape, 0)
    assert np.abs(problem.residual[INNER]).max() < 1e-4
