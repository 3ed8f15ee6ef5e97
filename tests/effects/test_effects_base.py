"""A base on springs: analytic frequencies, weight, and the limits of a stiff and a floating base."""

from __future__ import annotations

import numpy as np
import pytest

from reference_model.simulation import simulate
from robot_model import (
    Actuator,
    Base,
    EffectUse,
    InputError,
    Joint,
    JointPD,
    Link,
    Reference,
    Robot,
    load_robot,
)

PRECISE = {"rtol": 1e-11, "atol": 1e-13}


def mount(**parameters: float) -> EffectUse:
    given = {"compliance": 1e-4, "mass": 60.0, "inertia": 8.0, **parameters}
    return EffectUse.model_validate({"effect": "base_motion", "at": "base", **given})


def arm(**changes: object) -> Robot:
    """A driven link, level, on a fixed base, under gravity along its axis."""
    given = {
        "name": "arm",
        "gravity": (0.0, 0.0, -9.81),
        "base": Base(rpy=(0.0, 0.0, 0.4), position=(0.3, -0.2, 0.1)),
        "links": (Link(name="rod", mass=4.0, center_of_mass=(0.5, 0.0, 0.0), inertia=(0.01, 0.4, 0.4)),),
        "joints": (
            Joint(name="shoulder", parent="base", child="rod", initial_velocity=0.5, actuator=Actuator()),
        ),
        "controller": JointPD(kp=60.0, kd=30.0, sample_time=0.0),
        "reference": Reference(duration=1.5, sample_rate=200.0),
    }
    return Robot.model_validate({**given, **changes})


def weight(axis: tuple[float, float, float]) -> Robot:
    """A carriage that hits its stop immediately and pushes the base."""
    slide = Joint(
        name="slide", kind="prismatic", parent="base", child="load", axis=axis, initial_velocity=1.0
    )
    return arm(
        gravity=(0.0, 0.0, 0.0),
        base=Base(),
        links=(Link(name="load", mass=2.0),),
        joints=(slide,),
        controller={"kind": "none"},
    )


def ringing(recording_time: np.ndarray, x: np.ndarray) -> complex:
    """The pole of a free, damped oscillation about any mean."""
    rows = np.column_stack([x[1:-1], x[:-2], np.ones(len(x) - 2)])
    first, second, _ = np.linalg.lstsq(rows, x[2:], rcond=None)[0]
    pole = np.log(np.roots([1.0, -first, -second]).astype(complex)) / (recording_time[1] - recording_time[0])
    return complex(pole[0])


def test_it_oscillates_like_a_damped_mass_on_a_spring() -> None:
    """A welded robot pushed off by a wheel's motor: translation is at rest, turning rings."""
    welded = arm(
        gravity=(0.0, 0.0, 0.0),
        base=Base(),
        joints=(Joint(name="weld", kind="fixed", parent="base", child="rod"),),
        links=(Link(name="rod", mass=1.0, inertia=(0.5, 0.5, 0.5)),),
        controller={"kind": "none"},
    )
    push = EffectUse.model_validate({"effect": "reaction_wheel", "at": "base", "torque_z": 1.0})
    robot = welded.with_effects(mount(arm=0.3, damping=2e-3), push)
    recording = simulate(robot, sensors=False, work=True, **PRECISE)
    stiffness, inertia = 0.3**2 / 1e-4, 8.0 + 0.5
    # phi'' + damping k/J phi' + k/J sin phi = -1/J, small angles of 1e-3 rad.
    square = stiffness / inertia
    pole = ringing(recording.time, recording["base.angular_velocity.z"])
    assert abs(pole) ** 2 == pytest.approx(square, rel=1e-5)
    assert -2 * pole.real == pytest.approx(2e-3 * square, rel=1e-4)
    balance = recording["robot.energy"] - recording["robot.work"]
    np.testing.assert_allclose(balance, balance[0], rtol=0, atol=1e-9)


def test_its_displacement_is_compliance_times_force() -> None:
    """A carriage that a constant force drives pushes its base back."""
    force = EffectUse.model_validate(
        {"effect": "external_torque", "at": "slide", "torque": 5.0, "start": 0.0, "duration": 100.0}
    )
    slow = mount(compliance=1e-5, damping=5e-2)
    recording = simulate(weight((1.0, 0.0, 0.0)).with_effects(slow, force), sensors=False, **PRECISE)
    # The reaction -5 N moves the base by -5e-5 m when the start has died out (0.05 s).
    assert recording["base.position.x"][-1] == pytest.approx(-5e-5, rel=1e-4)
    assert abs(recording["base.position.y"][-1]) < 1e-12


def test_the_mount_carries_the_weight_from_the_start() -> None:
    still = arm(joints=(Joint(name="shoulder", parent="base", child="rod", actuator=Actuator()),))
    recording = simulate(still.with_effects(mount()), sensors=False, **PRECISE)
    for axis, place in zip("xyz", (0.3, -0.2, 0.1)):
        np.testing.assert_allclose(recording[f"base.position.{axis}"], place, rtol=0, atol=1e-10)


def test_energy_and_work() -> None:
    recording = simulate(arm().with_effects(mount()), sensors=False, work=True, **PRECISE)
    balance = recording["robot.energy"] - recording["robot.work"]
    np.testing.assert_allclose(balance, balance[0], rtol=0, atol=1e-8)
    assert np.ptp(recording["base.position.x"]) > 1e-5


def test_zero_compliance_leaves_the_robot_unchanged() -> None:
    without = simulate(arm(), sensors=False)
    absent = simulate(arm().with_effects(mount(compliance=0.0)), sensors=False)
    assert set(absent.channels) == set(without.channels)
    for name in without.channels:
        np.testing.assert_array_equal(absent[name], without[name])


def test_a_stiff_mount_converges_linearly_to_the_fixed_base() -> None:
    rigid = simulate(arm(), sensors=False, **PRECISE)

    def gap(compliance: float) -> float:
        soft = simulate(
            arm().with_effects(mount(compliance=compliance, damping=5e-3)), sensors=False, **PRECISE
        )
        return float(np.abs(soft["shoulder.position"] - rigid["shoulder.position"]).max())

    assert gap(2e-6) / gap(1e-6) == pytest.approx(2.0, rel=0.05)


def test_a_very_soft_mount_is_a_free_base() -> None:
    weightless = arm(gravity=(0.0, 0.0, 0.0))
    free = weightless.model_copy(
        update={
            "base": Base(
                kind="free",
                mass=60.0,
                inertia=(8.0, 8.0, 8.0),
                rpy=(0.0, 0.0, 0.4),
                position=(0.3, -0.2, 0.1),
            )
        }
    )
    loose = simulate(weightless.with_effects(mount(compliance=1e9)), sensors=False, **PRECISE)
    floating = simulate(free, sensors=False, **PRECISE)
    for name in ("shoulder.position", "base.position.x", "base.angular_velocity.z"):
        # 1e-9 N per metre moves 60 kg by less than 1e-11 m in 1.5 s.
        np.testing.assert_allclose(loose[name], floating[name], rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    ("robot", "use", "sentence"),
    [
        (load_robot("six_joint_space_arm"), mount(), "free already"),
        (arm(), mount(mass=0.0, inertia=0.0), "has no mass"),
        (arm(), mount(inertia=0.0), "no moments of inertia"),
    ],
)
def test_impossible_mounts_are_refused(robot: Robot, use: EffectUse, sentence: str) -> None:
    with pytest.raises(InputError, match=sentence) as caught:
        simulate(robot.with_effects(use))
    assert "effect 'base_motion' at 'base'" in str(caught.value)
