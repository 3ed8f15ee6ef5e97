"""Joints with clearance: falls, impacts, sag and friction in closed form, limits, balances, both engines."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import tomli_w
from scipy.integrate import solve_ivp

import exudyn_model
from benchmarks.cross_validation.robots import rigid
from reference_model.simulation import simulate
from robot_model import InputError, Recording, Robot, load_robot, robot_from_toml, robot_to_toml

GRAVITY, MASS = 9.81, 2.0
#: Spread over a second a contact of this stiffness takes some milliseconds.
PLAY = {"radial": 1e-3, "journal_radius": 0.02, "stiffness": 1e8, "restitution": 0.9}


def reference(robot: Robot) -> Recording:
    return simulate(robot, sensors=False)


def exudyn(robot: Robot) -> Recording:
    return exudyn_model.simulate(robot, sensors=False, step=2e-4)


both = pytest.mark.parametrize("run", [reference, exudyn])
#: What a test of both engines beside each other holds too.
also_by_exudyn = pytest.mark.parametrize("run", [reference, pytest.param(exudyn, marks=pytest.mark.proof)])


def journal(duration: float = 0.1, rate: float = 1000.0, speed: float = 0.0, **play: float) -> Robot:
    """A wheel whose axle, across gravity, has play in its bearing."""
    return Robot.model_validate(
        {
            "name": "wheel",
            "gravity": (0.0, -GRAVITY, 0.0),
            "links": [{"name": "wheel", "mass": MASS, "inertia": (0.01, 0.01, 0.02)}],
            "joints": [
                {
                    "name": "axle",
                    "parent": "base",
                    "child": "wheel",
                    "initial_velocity": speed,
                    "clearance": {**PLAY, **play},
                }
            ],
            "reference": {"duration": duration, "sample_rate": rate},
        }
    )


def height(run: Recording) -> np.ndarray:
    """Of the journal's centre [m]; the slides are along two axes across the joint's z."""
    robot_y = {"axle_clearance_x": 0.0, "axle_clearance_y": 1.0}
    return sum(share * run[f"{name}.position"] for name, share in robot_y.items())


@both
def test_the_journal_falls_through_its_clearance_and_bounces(run: Callable[[Robot], Recording]) -> None:
    found = run(journal(duration=0.03, rate=5000.0))
    y, fall = height(found), np.sqrt(2 * 1e-3 / GRAVITY)
    before = found.time < fall
    np.testing.assert_allclose(y[before], -GRAVITY / 2 * found.time[before] ** 2, atol=1e-9)

    def strikes(t: float, x: np.ndarray) -> list[float]:
        depth = max(-x[0] - 1e-3, 0.0)
        lost = 0.75 * (1 - 0.9**2) * -x[1] / (GRAVITY * fall)
        return [x[1], PLAY["stiffness"] * depth**1.5 * max(1 + lost, 0) / MASS - GRAVITY]

    times = found.time[~before]
    exact = solve_ivp(strikes, (fall, 0.03), [-1e-3, -GRAVITY * fall], t_eval=times, rtol=1e-10, atol=1e-13)
    np.testing.assert_allclose(y[~before], exact.y[0], atol=4e-6)
    rebound = exact.y[1].max() / (GRAVITY * fall)
    assert rebound == pytest.approx(0.9, abs=0.03)  # the law gives its restitution back to first order


@also_by_exudyn
def test_at_rest_the_journal_sags_by_the_contact_deformation(run: Callable[[Robot], Recording]) -> None:
    found = run(journal(duration=1.0, rate=100.0, restitution=0.2, stiffness=1e7))
    depth = (MASS * GRAVITY / 1e7) ** (2 / 3)
    np.testing.assert_allclose(height(found)[-1], -1e-3 - depth, rtol=1e-3)
    np.testing.assert_allclose(found["axle.contact_force"][-1], MASS * GRAVITY, rtol=1e-3)


@also_by_exudyn
def test_a_spinning_journal_climbs_to_the_angle_of_friction(run: Callable[[Robot], Recording]) -> None:
    """At the angle phi with tan(phi) = mu the friction is m g sin(phi), and slows the wheel."""
    found = run(journal(duration=0.3, rate=1000.0, speed=20.0, restitution=0.2, friction=0.2, radial=1e-4))
    late = found.time > 0.1
    slope = np.polyfit(found.time[late], found["axle.velocity"][late], 1)[0]
    phi = np.arctan(0.2)
    # The journal goes on swinging about that angle, as a pendulum of the clearance's length.
    assert slope == pytest.approx(-MASS * GRAVITY * np.sin(phi) * PLAY["journal_radius"] / 0.02, rel=0.02)
    x, y = found["axle_clearance_x.position"][late], found["axle_clearance_y.position"][late]
    assert abs(x.mean() / y.mean()) == pytest.approx(np.tan(phi), rel=0.1)


def arm(joint: str = "joint2", base: str = "fixed", **play: float) -> Robot:
    data = load_robot("two_link_arm").model_dump()
    data |= {"sensors": [], "effects": [], "controller": {"kind": "pd", "kp": 400.0, "kd": 40.0}}
    if base == "free":
        data["base"] = {"kind": "free", "mass": 50.0, "inertia": (5.0, 5.0, 5.0)}
        data["gravity"] = (0.0, 0.0, 0.0)
    for item in data["joints"]:
        if item["name"] == joint:
            item["clearance"] = {**PLAY, **play}
    data["reference"] = {
        "duration": 0.2,
        "sample_rate": 500.0,
        "joints": [
            {"joint": "joint1", "kind": "quintic", "displacement": 0.4, "duration": 0.2},
            {"joint": "joint2", "kind": "quintic", "displacement": -0.5, "duration": 0.2},
        ],
    }
    return Robot.model_validate(data)


def test_engines_agree_on_rattling() -> None:
    robot = arm(restitution=0.5, friction=0.1)
    own = reference(robot)
    other = exudyn_model.simulate(robot, sensors=False, step=4e-4)
    for name in ("joint2_clearance_x.position", "joint1.position"):
        assert np.ptp(own[name]) > 1e-3
        np.testing.assert_allclose(own[name], other[name], atol=1e-6, err_msg=name)
    pressed = own["joint2.contact_force"]
    assert pressed.max() > 50
    np.testing.assert_allclose(pressed, other["joint2.contact_force"], atol=0.02 * pressed.max())


@pytest.mark.proof
def test_engines_agree_on_rattling_with_free_base_and_skew_axes() -> None:
    data = rigid().model_dump()
    data |= {"controller": {"kind": "pd", "kp": 400.0, "kd": 40.0}}
    data["joints"][1]["clearance"] = {**PLAY, "restitution": 0.5, "friction": 0.1}
    data["reference"] |= {"duration": 0.05, "sample_rate": 200.0}
    data["reference"]["joints"] = [
        {"joint": name, "kind": "quintic", "displacement": far, "duration": 0.05}
        for name, far in (("shoulder", 0.1), ("elbow", -0.15))
    ]
    robot = Robot.model_validate(data)
    own = reference(robot)
    other = exudyn_model.simulate(robot, sensors=False, step=4e-4)
    for name in ("elbow_clearance_x.position", "elbow_clearance_y.position", "base.position.z"):
        assert np.ptp(own[name]) > 1e-4
        np.testing.assert_allclose(own[name], other[name], atol=0.01 * np.ptp(own[name]), err_msg=name)
    assert own["elbow.contact_force"].max() > 50


def test_a_small_clearance_converges_to_the_ideal_joint() -> None:
    ideal = load_robot("two_link_arm").model_dump()
    loose = reference(arm(radial=1e-7, stiffness=1e10, restitution=0.3))
    data = arm().model_dump()
    for joint in data["joints"]:
        joint["clearance"] = None
    ideal = reference(Robot.model_validate(data))
    np.testing.assert_allclose(loose["joint1.position"], ideal["joint1.position"], atol=1e-5)
    np.testing.assert_allclose(loose["joint2.position"], ideal["joint2.position"], atol=1e-5)


def test_contact_conserves_total_momentum() -> None:
    found = reference(arm(base="free", friction=0.2))
    assert np.ptp(found["joint2_clearance_y.position"]) > 1e-4
    for channel in (name for name in found if "momentum" in name):
        np.testing.assert_allclose(found[channel], 0.0, atol=1e-7)


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"radial": -1e-4}, r"radial.*-0.0001"),
        ({"radial": 0.0}, "radial"),
        ({"restitution": 1.2}, "restitution"),
        ({"stiffness": 0.0}, "stiffness"),
        ({"friction": -0.1}, "friction"),
    ],
)
def test_impossible_clearances_are_refused(changes: dict, sentence: str) -> None:
    data = journal().model_dump(exclude_none=True)
    data["joints"][0]["clearance"] |= changes
    with pytest.raises(InputError, match=sentence):
        robot_from_toml(tomli_w.dumps(data))


def test_only_revolute_joints_have_clearance_and_its_names_are_reserved() -> None:
    data = journal().model_dump(exclude_none=True)
    data["joints"][0]["kind"] = "prismatic"
    with pytest.raises(InputError, match="clearance is of revolute joints"):
        robot_from_toml(tomli_w.dumps(data))
    named = journal().model_dump(exclude_none=True)
    named["links"] = [*named["links"], {"name": "axle_clearance_y", "mass": 1.0}]
    weld = {"name": "weld", "kind": "fixed", "parent": "wheel", "child": "axle_clearance_y"}
    named["joints"] = [*named["joints"], weld]
    with pytest.raises(InputError, match="axle_clearance_y"):
        reference(robot_from_toml(tomli_w.dumps(named)))


def test_clearance_round_trips_through_a_file() -> None:
    assert robot_from_toml(robot_to_toml(journal())) == journal()
