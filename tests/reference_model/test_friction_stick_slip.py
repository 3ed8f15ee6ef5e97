"""Stick-slip and hunting: limit cycles due to dry friction, against closed forms."""

from __future__ import annotations

import numpy as np
from sliding_blocks import MASS, block, of_torque, ramp

from reference_model.simulation import simulate
from robot_model import Robot

STIFFNESS, KINETIC, STATIC, SPEED = 1000.0, 6.0, 10.0, 0.1


def dragged(fall: float, duration: float = 3.0):
    """A block that a spring drags over the floor: a mass on a moving belt, seen from the belt.

    The spring's far end moves at SPEED; `fall` is the speed over which the level falls to the kinetic one.
    """
    robot = block(
        of_torque("slide", KINETIC, STATIC, fall),
        controller={"kind": "pd", "kp": STIFFNESS, "kd": 0.0},
        motion=[ramp("slide", SPEED, duration)],
        duration=duration,
        rate=1000.0,
    )
    return simulate(robot, sensors=False, stiction=True)


def starts(sticking: np.ndarray) -> np.ndarray:
    """Samples at which sliding starts."""
    return np.flatnonzero((sticking[:-1] == 1) & (sticking[1:] == 0)) + 1


def test_a_mass_on_a_belt_follows_the_closed_form_cycle() -> None:
    """Spring extension u while sliding: m u'' = -k u + F_k, from u = F_s/k, u' = V until u' = V again.

    So k u - F_k swings from D = F_s - F_k to -D through an angle 2 pi - 2 atan(D w / (k V)), w^2 = k/m, and
    sticking takes 2 D / (k V) until the spring is back at F_s (Den Hartog, Mechanical Vibrations, 1956).
    """
    omega = np.sqrt(STIFFNESS / MASS)
    excess = (STATIC - KINETIC) / STIFFNESS
    slide = (2 * np.pi - 2 * np.arctan(excess * omega / SPEED)) / omega
    period = slide + 2 * excess / SPEED
    swing = np.hypot(excess, SPEED / omega)
    errors = []
    for fall in (1e-3, 1e-5):
        recording = dragged(fall)
        begins = recording.time[starts(recording["slide.sticking"])][1:]
        extension = recording["slide.torque"] / STIFFNESS
        late = recording.time > begins[0]
        found = np.diff(begins)
        np.testing.assert_allclose(found, found[0], atol=2.5e-3)  # a sample each, and the cycle settles
        errors.append(np.mean(found) - period)
        # The longest extension is met to (w h)^2/2 of the swing; leaving late makes the swing larger.
        swings = extension[late].max() - KINETIC / STIFFNESS, KINETIC / STIFFNESS - extension[late].min()
        np.testing.assert_allclose(swings, swing, rtol={1e-3: 0.05, 1e-5: 3e-3}[fall])
    # Leaving the static level takes about (2 m fall / (k V))^(1/2), 6.3 ms and 0.63 ms, and a few of it.
    delays = np.sqrt(2 * MASS * np.array([1e-3, 1e-5]) / (STIFFNESS * SPEED))
    assert np.all(np.abs(errors) < 3 * delays)
    assert abs(errors[1]) < 0.01 * period


def test_without_excess_static_friction_the_belt_drags_steadily() -> None:
    recording = simulate(
        block(
            of_torque("slide", KINETIC),
            {"effect": "viscous_friction", "at": "slide", "coefficient": 5.0},
            controller={"kind": "pd", "kp": STIFFNESS, "kd": 0.0},
            motion=[ramp("slide", SPEED, 6.0)],
            duration=6.0,
            rate=200.0,
        ),
        sensors=False,
        stiction=True,
    )
    late = recording.time > 5.5
    np.testing.assert_allclose(recording["slide.velocity"][late], SPEED, rtol=1e-2)
    assert not recording["slide.sticking"][late].any()


def hunting(static: float, duration: float = 60.0) -> tuple[np.ndarray, float]:
    """Places where a block under PID control that is to come to 0 from 5 cm away stops, and its last one."""
    data = block(
        of_torque("slide", 2.0, static, 0.002),
        controller={"kind": "pd", "kp": 400.0, "kd": 10.0, "ki": 600.0},
        duration=duration,
        rate=50.0,
    ).model_dump()
    data["joints"][0]["initial_position"] = 0.05
    times = (0.0, 0.1, 0.2, duration)
    data["reference"]["joints"] = [
        {"joint": "slide", "kind": "table", "times": times, "positions": (0.0,) * 4}
    ]
    recording = simulate(Robot.model_validate(data), sensors=False, stiction=True)
    sticking, position = recording["slide.sticking"], recording["slide.position"]
    return position[np.flatnonzero((sticking[1:] == 1) & (sticking[:-1] == 0)) + 1], position[-1]


def test_integral_action_hunts_where_static_friction_exceeds_kinetic() -> None:
    """A limit cycle through the target (Armstrong-Helouvry and Amin, Automatica 32 (1996) 679-692)."""
    stops, _ = hunting(static=4.0)
    last = stops[-6:]
    assert len(stops) > 20
    assert np.all(last[:-1] * last[1:] < 0)
    np.testing.assert_allclose(np.abs(last), np.abs(last).mean(), rtol=1e-3)
    assert np.abs(last).mean() > 1e-3


def test_integral_action_converges_without_excess_static_friction() -> None:
    stops, last = hunting(static=2.0)
    assert len(stops) <= 3
    assert abs(last) < 1e-5
