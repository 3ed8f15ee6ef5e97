"""Contact against Hertz's closed forms, the restitution of Hunt and Crossley, and momentum."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

from reference_model.simulation import simulate
from robot_model import (
    Actuator,
    Base,
    Beam,
    EffectUse,
    InputError,
    Joint,
    JointPD,
    Link,
    Recording,
    Reference,
    Robot,
    Tube,
)

#: The force has an edge in its third derivative; absolute figures beside forces of some hundred newtons.
PRECISE = {"rtol": 1e-11, "atol": 1e-13}
MASS, SPEED, STIFFNESS = 3.0, 0.5, 2e6


def contact(at: str, **parameters: float) -> EffectUse:
    given = {"stiffness": STIFFNESS, "offset": 0.0, **parameters}
    return EffectUse.model_validate({"effect": "contact", "at": at, **given})


def puck(duration: float = 0.5) -> Robot:
    """A mass that slides towards a wall 0.1 m ahead of it along -z."""
    return Robot(
        name="puck",
        links=(Link(name="puck", mass=MASS),),
        joints=(
            Joint(
                name="slide",
                kind="prismatic",
                parent="base",
                child="puck",
                initial_position=0.1,
                initial_velocity=-SPEED,
            ),
        ),
        reference=Reference(duration=duration, sample_rate=10000.0),
    )


def rebound(**parameters: float) -> Recording:
    return simulate(puck().with_effects(contact("puck", **parameters)), sensors=False, work=True, **PRECISE)


def test_an_elastic_impact_has_hertz_depth_and_duration_and_full_rebound_speed() -> None:
    recording = rebound()
    depth = -recording["slide.position"]
    deepest = (5 * MASS * SPEED**2 / (4 * STIFFNESS)) ** 0.4  # from 2/5 K d^2.5 = 1/2 m v^2
    assert depth.max() == pytest.approx(deepest, rel=1e-4)  # sampled every 0.1 ms of a bow of 7 ms
    touching = recording.time[depth > 0]
    # 2 int dd/sqrt(v^2 - 4K/(5m) d^2.5) = 2.94327 d_max/v (Johnson, Contact Mechanics, 1985, eq. 11.24)
    assert touching[-1] - touching[0] == pytest.approx(2.94327 * deepest / SPEED, abs=2e-4)
    assert recording["slide.velocity"][-1] == pytest.approx(SPEED, rel=1e-8)
    np.testing.assert_allclose(recording["robot.energy"], 0.5 * MASS * SPEED**2, rtol=1e-8)


@pytest.mark.parametrize("damping", [0.05, 0.5, 3.0])
def test_restitution_follows_hunt_and_crossley(damping: float) -> None:
    """m u du = -K d^1.5 (1 + c u) dd: u - ln(1 + u) is the same at both ends, u = c times the speed."""
    recording = rebound(damping=damping)
    u = damping * SPEED

    def gap(e: float) -> float:
        return float((u - np.log1p(u)) - (-e * u - np.log1p(-e * u)))

    e = brentq(gap, 1e-6, min(1.0, (1 - 1e-12) / u))
    assert recording["slide.velocity"][-1] == pytest.approx(e * SPEED, rel=1e-7)
    assert e == pytest.approx(1 - 2 / 3 * u, abs=u**2)
    balance = recording["robot.energy"] - recording["robot.work"]
    np.testing.assert_allclose(balance, balance[0], rtol=0, atol=1e-8)


def flyer(**changes: object) -> Robot:
    """A free base whose arm swings into a wall."""
    given = {
        "name": "flyer",
        "base": Base(kind="free", mass=40.0, inertia=(5.0, 6.0, 7.0)),
        "links": (Link(name="arm", mass=5.0, center_of_mass=(0.5, 0.0, 0.0), inertia=(0.1, 0.5, 0.5)),),
        "joints": (
            Joint(
                name="shoulder",
                parent="base",
                child="arm",
                origin=(0.4, 0.1, 0.2),
                initial_velocity=0.8,
                actuator=Actuator(),
            ),
        ),
        "controller": JointPD(kp=5.0, kd=3.0, sample_time=0.0),
        "reference": Reference(duration=1.5, sample_rate=400.0),
    }
    return Robot.model_validate({**given, **changes})


WALL = {"x": 1.0, "normal_y": -1.0, "normal_z": 0.0, "offset": -0.2, "stiffness": 1e5, "damping": 0.3}


def test_contact_changes_momentum_along_the_wall_normal_only() -> None:
    recording = simulate(flyer().with_effects(contact("arm", **WALL)), sensors=False, work=True, **PRECISE)
    momentum = np.column_stack([recording[f"robot.linear_momentum.{axis}"] for axis in "xyz"])
    step = momentum[-1] - momentum[0]
    assert step[1] < -1.0
    np.testing.assert_allclose(step[[0, 2]], 0.0, atol=1e-8)
    balance = recording["robot.energy"] - recording["robot.work"]
    np.testing.assert_allclose(balance, balance[0], rtol=0, atol=1e-8)
    plain = simulate(flyer(), sensors=False, **PRECISE)
    assert np.ptp(plain["robot.linear_momentum.y"]) < 1e-8
    before = recording.time < 0.1  # the wall is 0.1 m from where the tip begins at 0.8 m/s
    for name in ("shoulder.position", "base.angular_velocity.z"):
        np.testing.assert_allclose(recording[name][before], plain[name][before], rtol=0, atol=1e-9)


def test_contact_uses_the_deflected_tip_of_a_flexible_link() -> None:
    beam = Beam(
        length=1.0,
        section=Tube(outer_diameter=0.02, inner_diameter=0.016),
        young=70e9,
        shear=27e9,
        density=2700.0,
        elements=6,
        modes=2,
        damping_ratio=0.01,
        tip={"mass": 0.5},
    )
    robot = flyer(links=(Link(name="arm", beam=beam),))
    recording = simulate(robot.with_effects(contact("arm", **WALL)), sensors=False, work=True, **PRECISE)
    balance = recording["robot.energy"] - recording["robot.work"]
    np.testing.assert_allclose(balance, balance[0], rtol=0, atol=1e-7)
    momentum = recording["robot.linear_momentum.y"]
    assert momentum[-1] - momentum[0] < -0.1
    assert np.abs(recording["arm.tip_deflection.y"]).max() > 1e-3


def test_zero_stiffness_leaves_the_robot_unchanged() -> None:
    without = simulate(flyer(), sensors=False)
    absent = simulate(flyer().with_effects(contact("arm", **{**WALL, "stiffness": 0.0})), sensors=False)
    for name in without.channels:
        np.testing.assert_array_equal(absent[name], without[name])


def test_a_wall_with_a_zero_normal_is_refused() -> None:
    with pytest.raises(InputError, match="the normal has zero length"):
        simulate(puck().with_effects(contact("puck", normal_z=0.0)))
