"""Robots small enough to be solved by hand."""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp
from scipy.special import ellipk

from reference_model.evaluation.model import RobotModel
from reference_model.passive.base_motion import BaseMotion
from reference_model.simulation import simulate
from robot_model import Robot

GRAVITY = 9.81


def pendulum(**joint) -> Robot:
    return Robot.model_validate(
        {
            "name": "pendulum",
            "gravity": (0.0, 0.0, -GRAVITY),
            "links": [
                {"name": "bob", "mass": 2.0, "center_of_mass": (0.0, 0.0, -0.7), "inertia": (0.1, 0.2, 0.1)}
            ],
            "joints": [{"name": "pivot", "parent": "base", "child": "bob", "axis": (0.0, 1.0, 0.0), **joint}],
            "reference": {"duration": 6.0, "sample_rate": 200.0},
        }
    )


def test_pendulum_torque() -> None:
    model = RobotModel(pendulum(actuator={"gear_ratio": 20.0, "rotor_inertia": 1e-3}))
    q, qd, qdd = np.random.default_rng(0).normal(size=(3, 50, 1))
    inertia = 0.2 + 2.0 * 0.7**2 + 20.0**2 * 1e-3
    wanted = inertia * qdd + 2.0 * GRAVITY * 0.7 * np.sin(q)
    np.testing.assert_allclose(model.inverse_dynamics(q, qd, qdd), wanted, rtol=1e-13)  # rounding
    # bearing: the bob's centripetal pull and weight in the plane of motion; the rotor puts nothing on it
    loads = model.bearing_loads(q, qd, qdd)[:, 0]
    radial = 2.0 * np.hypot(0.7 * qd**2 + GRAVITY * np.cos(q), 0.7 * qdd + GRAVITY * np.sin(q))[:, 0]
    np.testing.assert_allclose(loads[:, 0], radial, rtol=1e-12)
    np.testing.assert_allclose(loads[:, 1:3], 0, atol=1e-12)
    np.testing.assert_allclose(loads[:, 3], radial, rtol=1e-12)


def test_pendulum_period() -> None:
    amplitude = 2.5
    recording = simulate(pendulum(initial_position=amplitude), sensors=False, rtol=1e-10, atol=1e-12)
    inertia = 0.2 + 2.0 * 0.7**2
    period = 4 * np.sqrt(inertia / (2.0 * GRAVITY * 0.7)) * ellipk(np.sin(amplitude / 2) ** 2)
    speed = recording["pivot.velocity"]
    down = np.flatnonzero((speed[1:-1] > 0) & (speed[2:] <= 0)) + 1  # a whole swing: at rest again
    rate = recording["pivot.acceleration"]
    returned = recording.time[down[0]] - speed[down[0]] / rate[down[0]]
    # Newton step from the sample before: error (dt)^2 times jerk over acceleration, below 1e-4 s
    assert abs(returned - period) < 1e-4
    assert np.ptp(recording["robot.energy"]) < 2e-6  # of 11 J, at 1e-10 per step over a thousand steps


def test_two_links_in_a_plane() -> None:
    """The textbook arm: Z, Coriolis and gravity terms (Siciliano et al., Robotics, 2009, 7.3.2)."""
    m1, m2, l1, c1, c2, i1, i2 = 3.0, 2.0, 0.6, 0.25, 0.35, 0.07, 0.05
    robot = Robot.model_validate(
        {
            "name": "planar",
            "gravity": (0.0, -GRAVITY, 0.0),
            "links": [
                {"name": "a", "mass": m1, "center_of_mass": (c1, 0, 0), "inertia": (0.05, 0.05, i1)},
                {"name": "b", "mass": m2, "center_of_mass": (c2, 0, 0), "inertia": (0.04, 0.04, i2)},
            ],
            "joints": [
                {"name": "j1", "parent": "base", "child": "a"},
                {"name": "j2", "parent": "a", "child": "b", "origin": (l1, 0, 0)},
            ],
        }
    )
    q, qd, qdd = np.random.default_rng(1).normal(size=(3, 40, 2))
    (q1, q2), (v1, v2), (a1, a2) = q.T, qd.T, qdd.T
    h = m2 * l1 * c2
    z11 = i1 + m1 * c1**2 + i2 + m2 * (l1**2 + c2**2) + 2 * h * np.cos(q2)
    z12 = i2 + m2 * c2**2 + h * np.cos(q2)
    z22 = i2 + m2 * c2**2
    g2 = m2 * GRAVITY * c2 * np.cos(q1 + q2)
    g1 = (m1 * c1 + m2 * l1) * GRAVITY * np.cos(q1) + g2
    wanted = np.stack(
        [
            z11 * a1 + z12 * a2 - h * np.sin(q2) * (2 * v1 * v2 + v2**2) + g1,
            z12 * a1 + z22 * a2 + h * np.sin(q2) * v1**2 + g2,
        ],
        axis=1,
    )
    np.testing.assert_allclose(RobotModel(robot).inverse_dynamics(q, qd, qdd), wanted, atol=1e-12)


def slider() -> Robot:
    """A mass that slides along a turning rail."""
    return Robot.model_validate(
        {
            "name": "slider",
            "links": [
                {"name": "rail", "inertia": (0.0, 0.3, 0.3)},
                {"name": "mass", "mass": 2.0},
            ],
            "joints": [
                {"name": "turn", "parent": "base", "child": "rail"},
                {"name": "slide", "kind": "prismatic", "parent": "rail", "child": "mass", "axis": (1, 0, 0)},
            ],
        }
    )


def test_sliding_mass_on_a_turning_rail() -> None:
    """Polar coordinates: m (rdd - r w^2) along the rail, (I + m r^2) wd + 2 m r rd w about the pivot."""
    q, qd, qdd = np.random.default_rng(2).normal(size=(3, 40, 2))
    r, (w, rd), (wd, rdd) = q[:, 1], qd.T, qdd.T
    wanted = np.stack([(0.3 + 2 * r**2) * wd + 4 * r * rd * w, 2 * (rdd - r * w**2)], axis=1)
    np.testing.assert_allclose(RobotModel(slider()).inverse_dynamics(q, qd, qdd), wanted, atol=1e-12)
    loads = RobotModel(slider()).bearing_loads(q, qd, qdd)[:, 1]
    np.testing.assert_allclose(loads[:, 0], np.abs(2 * (r * wd + 2 * rd * w)), atol=1e-11)


def test_free_body_obeys_eulers_equations() -> None:
    inertia, start = np.array([1.0, 2.0, 2.6]), np.array([0.05, 1.2, -0.03])
    robot = Robot.model_validate(
        {
            "name": "top",
            "base": {"kind": "free", "mass": 3.0, "inertia": tuple(inertia)},
            "links": [],
            "joints": [],
        }
    )
    model, none = RobotModel(robot), np.zeros((1, 0))

    def rate(_: float, omega: np.ndarray) -> np.ndarray:
        base = BaseMotion([[1, 0, 0, 0]], [omega], *np.zeros((3, 1, 3)))
        return model.forward_dynamics(none, none, none, base=base)[0, 3:]

    def euler(_: float, omega: np.ndarray) -> np.ndarray:
        return np.cross(inertia * omega, omega) / inertia

    options = {"t_span": (0, 20), "y0": start, "rtol": 1e-10, "atol": 1e-12, "t_eval": [20.0]}
    found, wanted = (solve_ivp(f, **options).y[:, -1] for f in (rate, euler))
    np.testing.assert_allclose(found, wanted, atol=1e-6)  # the unstable middle axis magnifies rounding
