"""Forces without a name: curves, memory, and coupling of joints, against closed forms and in diagnoses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from recorded_arm import COULOMB, VISCOUS, Hidden, nothing, recorded
from scipy.signal import lfilter

from missing_physics.diagnosis import diagnose
from missing_physics.reporting.elements.curves import drawn
from missing_physics.results.result import Diagnosis
from missing_physics.unnamed import CURVES, MEMORIES, UnknownForce, driven_by
from reference_model.effects.along import EffectAlong
from reference_model.effects.base import JointSignals
from robot_model import EffectUse, Recording, Robot, robot_from_toml

Array = NDArray[np.float64]

#: Time constant and size of a fluid that yields, and width and slope of an element of hysteresis.
YIELDS, THICK = 0.4, 3.0
WIDTH, SLOPE = 0.3, 2.0


def with_friction(arm: Robot) -> Robot:
    return arm.with_effects(
        EffectUse(effect="viscous_friction", at="joint", coefficient=VISCOUS),
        EffectUse(effect="coulomb_friction", at="joint", torque=COULOMB),
    )


def diagnosed(robot: Robot, hidden: Hidden) -> Diagnosis:
    return diagnose(robot, [recorded(hidden, seed=1)], [recorded(hidden, seed=2)]).diagnosis


def yielding(time: Array, position: Array, velocity: Array) -> Array:
    """Drag of a fluid that takes a time to yield: T x' = c v - x."""
    kept = np.exp(-(time[1] - time[0]) / YIELDS)
    mean = 0.5 * (velocity + np.concatenate([velocity[:1], velocity[:-1]]))
    return np.asarray(lfilter([THICK * (1.0 - kept)], [1.0, -kept], mean))


def hysteresis(time: Array, position: Array, velocity: Array) -> Array:
    """A play of some width behind a spring: the same at every speed."""
    found, kept = np.empty_like(position), position[0]
    for k, q in enumerate(position):
        found[k] = kept = min(max(kept, q - WIDTH), q + WIDTH)
    return SLOPE * found


def with_offset(size: float) -> Hidden:
    return lambda time, position, velocity: hysteresis(time, position, velocity) + size


def hardening(time: Array, position: Array, velocity: Array) -> Array:
    return 0.8 * position**3


def signals(position: Array, velocity: Array, step: float) -> Array:
    found = np.zeros((position.size, len(JointSignals.CHANNELS)))
    found[:, 0] = step * np.arange(position.size)
    found[:, 1], found[:, 2] = position, velocity
    return found


def parameters(force: UnknownForce, random: np.random.Generator, **given: float) -> dict[str, float]:
    return {**{p.name: random.normal() for p in force.estimated}, **force.defaults(), **given}


@pytest.mark.parametrize("force", MEMORIES, ids=lambda force: force.id)
def test_memory_after_a_start_at_constant_speed_is_the_reported_curve(force: UnknownForce) -> None:
    speed = 0.7
    values = parameters(force, np.random.default_rng(1), low=0.05, high=1.0, speed=speed)
    knots, step = force.knots(values), 1e-3
    length = knots[-1] / (1.0 if force.variable == "time_since_start" else speed)
    time = np.arange(0.0, length, step)
    along = EffectAlong(force, transition=1e-9)
    made = along.torque(signals(speed * time, np.full(time.size, speed), step), values)
    curve = force.shape(values) @ [values[p.name] for p in force.estimated]
    at = time if force.variable == "time_since_start" else speed * time
    # The states are integrated to 1e-4 of the largest torque.
    assert np.allclose(np.interp(knots[:-1], at, made), curve[:-1], atol=1e-3 * np.abs(curve).max())


@pytest.mark.parametrize("force", CURVES, ids=lambda force: force.id)
def test_a_curve_goes_on_with_its_slope_beyond_its_range(force: UnknownForce) -> None:
    values = parameters(force, np.random.default_rng(2), low=0.2, high=1.5)
    values = dict(values, low=0.0) if force.variable == "time" else values
    x = np.linspace(values["high"] - 1e-3, values["high"] + 0.5, 600)
    rows = signals(x if force.variable == "position" else 0.0 * x, np.full(x.size, 0.5), 1.0)
    column = {"time": 0, "position": 1, "velocity": 2}[force.variable]
    rows[:, column] = x
    made = EffectAlong(force, transition=1e-9).torque(rows, values)
    ends = np.searchsorted(x, values["high"])
    slope = np.diff(made) / np.diff(x)
    assert slope[ends - 1] == pytest.approx(slope[ends + 1], rel=0.05)
    if force.variable != "velocity":  # its curve runs over the area sinus of the speed
        assert np.allclose(slope[ends + 1 :], slope[ends + 1], rtol=1e-6)


def test_a_force_of_another_joint_vanishes_with_its_speed_and_may_oppose_the_own_motion() -> None:
    plain, against = driven_by("wrist")
    random = np.random.default_rng(3)
    theirs, own = np.linspace(-1.9, 1.9, 41), np.where(np.arange(41) % 2 == 0, 1.0, -1.0)
    rows = np.column_stack([signals(theirs, theirs, 0.1), own])
    one = EffectAlong(plain, directed=True).torque(rows, parameters(plain, random, low=-2.0, high=2.0))
    other = EffectAlong(against, directed=True).torque(rows, parameters(against, random, low=0.0, high=2.0))
    assert one[20] == pytest.approx(0.0, abs=1e-12)
    assert other[20] == pytest.approx(0.0, abs=1e-12)
    assert np.abs(one[0] + one[-1]) > 0.1  # neither odd nor even
    assert np.allclose(
        own * other, (own * other)[::-1]
    )  # friction, the same for both directions of the other
    assert driven_by("wrist")[0] is plain  # formulas are compiled once
    assert {force.id for force in driven_by("elbow")}.isdisjoint({plain.id, against.id})


def test_drag_of_a_fluid_that_yields_has_no_name(arm: Robot) -> None:
    diagnosis = diagnosed(with_friction(arm), yielding)
    assert diagnosis.findings == ()
    (force,) = diagnosis.unnamed
    assert force.depends_on == ("joint.time_since_start",)
    assert force.share > 0.95
    assert "a force that depends on past speeds predicts" in force.words
    assert drawn(force, arm).across == "joint's time since start [s]"
    assert drawn(force, arm).title.endswith("after a start at the fastest recorded speed")
    (curve,), (knots,) = force.curves, force.knots
    grows = np.interp([0.2, 0.4, 0.8, 2.0], knots, curve.torque)
    truth = 1.0 - np.exp(-np.array([0.2, 0.4, 0.8, 2.0]) / YIELDS)
    assert grows / grows[-1] == pytest.approx(truth / truth[-1], abs=0.1)  # four rates, not this one


def test_hysteresis_has_no_name(arm: Robot) -> None:
    diagnosis = diagnosed(with_friction(arm), hysteresis)
    assert diagnosis.findings == ()
    (force,) = diagnosis.unnamed
    assert force.depends_on == ("joint.distance_since_start",)
    assert force.share > 0.95
    assert drawn(force, arm).across == "joint's distance since start [rad]"


def test_a_spring_that_hardens_has_no_name_and_is_predicted_beyond_the_fitted_range(arm: Robot) -> None:
    fit, held = recorded(hardening, seed=4), recorded(hardening, seed=1)
    assert np.ptp(held["joint.position"]) > 1.1 * np.ptp(fit["joint.position"])
    diagnosis = diagnose(with_friction(arm), [fit], [held]).diagnosis
    assert diagnosis.findings == ()
    (force,) = diagnosis.unnamed
    assert force.depends_on == ("joint.position",)
    assert force.share > 0.9


def test_an_interval_of_a_curve_is_narrow_where_data_are(arm: Robot) -> None:
    """Coefficients of states that are nearly alike are uncertain, their sum is not."""
    (force,) = diagnosed(with_friction(arm), yielding).unnamed
    (curve,) = force.curves
    low, high = np.array(curve.ci95).T
    assert np.median(high - low) < 0.1 * np.ptp(curve.torque)


def test_the_order_of_recordings_of_different_width_does_not_matter(arm: Robot) -> None:
    """A curve covers what all recordings cover together."""
    whole, random = recorded(hardening, seed=4), np.random.default_rng(9)
    q = 0.1 * whole["joint.position"]
    v = np.gradient(q, whole.time)
    torque = (
        0.2 * np.gradient(v, whole.time) + VISCOUS * v + COULOMB * np.sign(v) + hardening(whole.time, q, v)
    )
    torque += random.normal(0.0, 0.01, q.size)
    small = replace(whole, channels={"joint.position": q, "joint.torque": torque}, source="small")
    wide, held = recorded(hardening, seed=1), recorded(hardening, seed=2)
    forces = [
        diagnose(with_friction(arm), runs, [held]).diagnosis.unnamed
        for runs in ([wide, small], [small, wide])
    ]
    assert [[force.depends_on for force in found] for found in forces] == [[("joint.position",)]] * 2
    assert forces[0][0].knots[0] == pytest.approx(forces[1][0].knots[0])
    assert forces[0][0].share == pytest.approx(forces[1][0].share, abs=0.02)


def test_a_curve_of_hysteresis_begins_at_the_offset(arm: Robot) -> None:
    ends = []
    for offset in (0.0, 0.7):
        diagnosis = diagnosed(with_friction(arm), with_offset(offset))
        (force,) = diagnosis.unnamed
        ends.append(force.curves[0].torque[0])
    assert ends[1] - ends[0] == pytest.approx(0.7, abs=0.05)


TWO = """
name = "wrist"
gravity = [0.0, 0.0, -9.81]

[base]
kind = "fixed"
{links}{joints}
[[sensors]]
channel = "first.torque"
noise = 0.01

[[sensors]]
channel = "second.torque"
noise = 0.01
"""
LINK = """
[[links]]
name = "{name}"
mass = 2.0
center_of_mass = [0.0, 0.0, 0.0]
inertia = [0.2, 0.2, 0.2]
"""
JOINT = """
[[joints]]
name = "{name}"
kind = "revolute"
parent = "{parent}"
child = "{child}"
axis = {axis}

[joints.actuator]
gear_ratio = 1.0
torque_limit = 50.0
"""


def wrist() -> Robot:
    """Two joints with axes at right angles, both through the centre of spherical bodies."""
    links = LINK.format(name="inner") + LINK.format(name="outer")
    joints = JOINT.format(name="first", parent="base", child="inner", axis="[0.0, 0.0, 1.0]")
    joints += JOINT.format(name="second", parent="inner", child="outer", axis="[1.0, 0.0, 0.0]")
    return robot_from_toml(TWO.format(links=links, joints=joints))


def coupled(seed: int) -> Recording:
    """The second joint's motion drags the first one."""
    one, two = recorded(nothing, seed=seed), recorded(nothing, seed=seed + 10)
    first, second = (np.gradient(run["joint.position"], run.time) for run in (one, two))
    inertia = (0.4, 0.2)
    random = np.random.default_rng(seed)
    torque = [
        size * np.gradient(rate, one.time) + VISCOUS * rate + COULOMB * np.sign(rate)
        for size, rate in zip(inertia, (first, second))
    ]
    channels = {
        "first.position": one["joint.position"],
        "second.position": two["joint.position"],
        "first.torque": torque[0] + 0.6 * second + random.normal(0.0, 0.01, one.time.size),
        "second.torque": torque[1] + random.normal(0.0, 0.01, one.time.size),
    }
    return replace(one, channels=channels)


def test_drag_by_another_joint_has_no_name() -> None:
    robot = wrist().with_effects(
        *(
            use
            for joint in ("first", "second")
            for use in (
                EffectUse(effect="viscous_friction", at=joint, coefficient=VISCOUS),
                EffectUse(effect="coulomb_friction", at=joint, torque=COULOMB),
            )
        )
    )
    diagnosis = diagnose(robot, [coupled(1)], [coupled(2)]).diagnosis
    assert diagnosis.findings == ()
    (force,) = diagnosis.unnamed
    assert (force.location, force.depends_on) == ("first", ("second.velocity",))
    assert force.share > 0.9
    assert "a curve over second's velocity predicts" in force.words
