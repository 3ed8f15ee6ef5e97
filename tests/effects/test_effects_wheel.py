"""Reaction wheels on the base against Euler's equations, and against an explicit rotor on a joint."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from reference_model.control.motion import reference_function
from reference_model.effects.catalogue import get_effect
from reference_model.plant.closed_loop import Plant
from reference_model.simulation import simulate
from robot_model import Base, EffectUse, Joint, Link, Recording, Reference, Robot

#: Tolerances of the integration below; errors add up over some thousand steps.
PRECISE = {"rtol": 1e-11, "atol": 1e-13}
RATES = tuple(f"base.angular_velocity.{axis}" for axis in "xyz")


def satellite(*, duration: float = 20.0) -> Robot:
    """A free base with a disc that spins on an axle through its centre."""
    return Robot(
        name="satellite",
        base=Base(kind="free", mass=50.0, inertia=(4.0, 4.0, 4.0)),
        links=(Link(name="disc", mass=2.0, inertia=(0.1, 0.1, 0.2)),),
        joints=(Joint(name="axle", parent="base", child="disc", initial_velocity=3.0),),
        reference=Reference(duration=duration, sample_rate=50.0),
    )


def wheel(**parameters: float) -> EffectUse:
    return EffectUse.model_validate({"effect": "reaction_wheel", "at": "base", **parameters})


def columns(recording: Recording, prefix: str) -> np.ndarray:
    return np.column_stack([recording[f"{prefix}.{axis}"] for axis in "xyz"])


def test_a_body_at_rest_stays_and_carries_the_wheels_momentum() -> None:
    robot = satellite().model_copy(update={"joints": (Joint(name="axle", parent="base", child="disc"),)})
    recording = simulate(robot.with_effects(wheel(momentum_x=3.0, momentum_z=-1.0)), sensors=False)
    assert np.abs(columns(recording, "base.angular_velocity")).max() == 0.0
    np.testing.assert_allclose(
        columns(recording, "robot.angular_momentum"), np.tile([3.0, 0.0, -1.0], (1001, 1)), atol=1e-14
    )


def test_motor_torque_turns_the_base_in_the_opposite_direction() -> None:
    robot = satellite().model_copy(
        update={"joints": (Joint(name="axle", kind="fixed", parent="base", child="disc"),)}
    )
    recording = simulate(robot.with_effects(wheel(torque_z=0.3)), sensors=False, **PRECISE)
    # J omega + h = 0 with h = 0.3 t and J = 4 + 0.2.
    np.testing.assert_allclose(
        recording["base.angular_velocity.z"], -0.3 * recording.time / 4.2, rtol=0, atol=1e-9
    )
    assert np.abs(columns(recording, "robot.angular_momentum")).max() < 1e-9


def test_an_unpowered_wheel_decays_and_transfers_its_momentum_to_the_base() -> None:
    robot = satellite().model_copy(
        update={"joints": (Joint(name="axle", kind="fixed", parent="base", child="disc"),)}
    )
    recording = simulate(robot.with_effects(wheel(momentum_y=2.0, drag=0.1)), sensors=False, **PRECISE)
    # J omega = h0 - h, h = h0 exp(-drag t), J = 4.1 about y.
    expected = 2.0 * (1 - np.exp(-0.1 * recording.time)) / 4.1
    np.testing.assert_allclose(recording["base.angular_velocity.y"], expected, rtol=0, atol=1e-9)


def test_a_wheel_makes_a_rotating_body_precess_at_the_analytic_rate() -> None:
    """J wd = -w x h of a body with J times the unit matrix: its rate turns about h at |h| / J."""
    ball = Robot(
        name="ball",
        base=Base(kind="free", mass=10.0, inertia=(2.0, 2.0, 2.0)),
        links=(),
        joints=(),
        reference=Reference(duration=1.0, sample_rate=50.0),
    )
    plant = Plant(ball.with_effects(wheel(momentum_z=1.5)))
    start = plant.initial(reference_function(ball))
    start[plant.layout.rows("base_velocity")] = [0.0, 0.0, 0.0, 0.4, 0.0, 0.1]
    empty = np.zeros(0)

    def rate(time: float, state: np.ndarray) -> np.ndarray:
        return np.asarray(plant.rate(time, state, empty, empty)).ravel()

    time = np.linspace(0.0, 10.0, 101)
    solution = solve_ivp(rate, (0.0, 10.0), start, t_eval=time, rtol=1e-11, atol=1e-13)
    omega = solution.y[plant.layout.rows("base_velocity")][3:].T
    angle = 1.5 / 2.0 * time
    expected = np.column_stack([0.4 * np.cos(angle), 0.4 * np.sin(angle), np.full_like(angle, 0.1)])
    np.testing.assert_allclose(omega, expected, rtol=0, atol=1e-8)


@pytest.mark.parametrize("inertia", [0.05, 0.4])
def test_the_effect_equals_an_explicit_rotor(inertia: float) -> None:
    """A rotor on a free axle, as bodies, moves the base as the effect does with its momentum."""

    def tumbler(*extra: tuple[Link, Joint]) -> Robot:
        arm = Link(name="arm", mass=5.0, center_of_mass=(0.6, 0.1, 0.2), inertia=(0.2, 0.5, 0.4))
        shoulder = Joint(
            name="shoulder",
            parent="base",
            child="arm",
            origin=(0.3, 0.2, 0.1),
            axis=(0.0, 1.0, 0.5),
            initial_velocity=1.5,
        )
        return Robot(
            name="tumbler",
            base=Base(kind="free", mass=30.0, inertia=(3.0, 4.0, 5.0), center_of_mass=(0.0, 0.05, 0.0)),
            links=(arm, *(link for link, _ in extra)),
            joints=(shoulder, *(joint for _, joint in extra)),
            reference=Reference(duration=4.0, sample_rate=50.0),
        )

    # All its inertia is about its axle, y; a body whose other moments vanish is no body, so the axle's
    # transverse moments are taken off the base instead.
    rotor = Link(name="rotor", inertia=(inertia / 2, inertia, inertia / 2))
    axle = Joint(name="axle", parent="base", child="rotor", axis=(0.0, 1.0, 0.0), initial_velocity=8.0)
    real = tumbler((rotor, axle))
    real = real.model_copy(
        update={"base": real.base.model_copy(update={"inertia": (3.0 - inertia / 2, 4.0, 5.0 - inertia / 2)})}
    )
    one = simulate(real, sensors=False, **PRECISE)
    # At the start the base is at rest, so that the rotor's momentum is inertia times its speed.
    effect = tumbler().with_effects(wheel(momentum_y=8.0 * inertia))
    other = simulate(effect, sensors=False, **PRECISE)
    for channel in (*RATES, "shoulder.position", *(f"robot.angular_momentum.{axis}" for axis in "xyz")):
        # The same motion by two formulations: integration errors only.
        np.testing.assert_allclose(one[channel], other[channel], rtol=0, atol=1e-8, err_msg=channel)


def test_an_imbalance_shakes_the_base_at_the_wheels_speed() -> None:
    robot = satellite(duration=2.0).model_copy(
        update={"joints": (Joint(name="axle", kind="fixed", parent="base", child="disc"),)}
    )
    use = wheel(momentum_z=0.5, rotor_inertia=0.01, imbalance=1e-4)
    recording = simulate(robot.with_effects(use), sensors=False, **PRECISE)
    # The force at the base's origin, its mass centre, U Omega^2 (cos, sin) with Omega = 50 rad/s.
    expected = 1e-4 * 50.0**2 / 52.0 * np.cos(50.0 * recording.time)
    np.testing.assert_allclose(recording["base.linear_acceleration.x"], expected, atol=1e-8)


def test_without_momentum_the_robot_is_unchanged() -> None:
    absent = simulate(satellite().with_effects(wheel()), sensors=False)
    without = simulate(satellite(), sensors=False)
    for name in without.channels:
        # One more state in the error control changes only the steps.
        np.testing.assert_allclose(absent[name], without[name], rtol=0, atol=1e-7, err_msg=name)


def test_work_and_energy_agree() -> None:
    use = wheel(momentum_x=2.0, torque_y=0.1, drag=0.05)
    recording = simulate(satellite().with_effects(use), sensors=False, work=True, **PRECISE)
    balance = recording["robot.energy"] - recording["robot.work"]
    np.testing.assert_allclose(balance, balance[0], rtol=0, atol=1e-8)
    assert np.ptp(recording["robot.energy"]) > 1e-3


def test_the_catalogue_describes_the_states() -> None:
    effect = get_effect("reaction_wheel")
    assert getattr(effect, "states", 0) == 6
