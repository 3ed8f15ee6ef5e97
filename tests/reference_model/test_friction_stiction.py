"""Exact stick and slip against closed forms: holding, breaking away, stopping, several joints, failures."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from sliding_blocks import GRAVITY, MASS, block, of_torque, on_load, ramp

from reference_model.plant import acting
from reference_model.simulation import simulate
from reference_model.steppers import sticking
from robot_model import InputError, Robot

#: The integration's tolerances, 1e-8 relative and 1e-10 absolute, with room for some hundred steps.
INTEGRATED = 1e-7


def exact(robot: Robot, **more):
    return simulate(robot, sensors=False, stiction=True, **more)


@pytest.mark.parametrize("friction", [on_load("slide", 0.3), of_torque("slide", 4.0)])
def test_a_block_on_an_incline_sticks_without_creep(friction: dict) -> None:
    recording = exact(block(friction, tilt=0.2, duration=100.0, rate=2.0))
    np.testing.assert_array_equal(recording["slide.position"], 0.0)  # not a rounding error
    np.testing.assert_array_equal(recording["slide.velocity"], 0.0)
    np.testing.assert_array_equal(recording["slide.acceleration"], 0.0)
    np.testing.assert_array_equal(recording["slide.sticking"], 1.0)
    weight = MASS * GRAVITY * np.sin(0.2)
    np.testing.assert_allclose(recording["slide.friction_torque"], -weight, rtol=1e-12)


@pytest.mark.parametrize(("excess", "holds"), [(-1e-6, True), (1e-6, False)])
def test_a_block_holds_up_to_the_angle_of_friction(excess: float, holds: bool) -> None:
    tilt = np.arctan(0.3 * (1 + excess))
    recording = exact(block(on_load("slide", 0.2, 0.3), tilt=tilt, duration=5.0))
    assert (recording["slide.position"][-1] == 0) == holds


def test_it_breaks_away_at_the_static_level() -> None:
    stiffness, speed, kinetic, static, fall = 200.0, 0.05, 0.2, 0.3, 0.05
    normal = MASS * GRAVITY
    robot = block(
        on_load("slide", kinetic, static, fall),
        controller={"kind": "pd", "kp": stiffness, "kd": 0.0},
        motion=[ramp("slide", speed, 1.0)],
        duration=1.0,
        rate=1000.0,
    )
    recording = exact(robot, rtol=1e-10, atol=1e-12)
    start = static * normal / (stiffness * speed)
    stuck = recording.time < start
    np.testing.assert_array_equal(recording["slide.position"][stuck], 0.0)
    held = stiffness * speed * recording.time[stuck]
    np.testing.assert_allclose(recording["slide.friction_torque"][stuck], -held, rtol=1e-10, atol=1e-10)

    def slides(t: float, x: np.ndarray) -> list[float]:
        level = normal * (kinetic + (static - kinetic) * np.exp(-((x[1] / fall) ** 2)))
        return [x[1], (stiffness * (speed * t - x[0]) - level) / MASS]

    after = recording.time[~stuck]
    run = solve_ivp(slides, (start, 1.0), [0.0, 0.0], t_eval=after, rtol=1e-10, atol=1e-13, method="DOP853")
    first = np.argmax(run.y[1] < 0) if np.any(run.y[1] < 0) else len(after)
    assert first > 100
    # Breaking away is unstable at a rate of (static - kinetic) W / (m fall): what 1e-10 of force too much
    # and the integration's tolerance leave grows by some e^20 before the slide is fast.
    np.testing.assert_allclose(recording["slide.position"][~stuck][:first], run.y[0][:first], atol=1e-6)


def test_a_sliding_block_stops_at_the_analytic_time_and_position() -> None:
    recording = exact(block(on_load("slide", 0.3), tilt=0.2, velocity=1.0, rate=200.0))
    braking = GRAVITY * (0.3 * np.cos(0.2) - np.sin(0.2))
    stop = 1.0 / braking
    time = np.minimum(recording.time, stop)
    wanted = time - braking * time**2 / 2
    np.testing.assert_allclose(recording["slide.position"], wanted, atol=1e-11)
    np.testing.assert_array_equal(recording["slide.sticking"], recording.time >= stop)
    np.testing.assert_array_equal(recording["slide.velocity"][recording.time >= stop], 0.0)


def test_a_block_on_a_steep_incline_reverses_without_sticking() -> None:
    tilt, mu = 0.4, 0.3
    recording = exact(block(on_load("slide", mu), tilt=tilt, velocity=-1.0, rate=200.0))
    up = GRAVITY * (np.sin(tilt) + mu * np.cos(tilt))
    down = GRAVITY * (np.sin(tilt) - mu * np.cos(tilt))
    time, turn = recording.time, 1.0 / up
    rising = -time + up * time**2 / 2
    falling = -1 / (2 * up) + down * (time - turn) ** 2 / 2
    wanted = np.where(time < turn, rising, falling)
    np.testing.assert_allclose(recording["slide.position"], wanted, atol=1e-9)
    assert not recording["slide.sticking"].any()


def stacked(lower: float, upper: float, velocity: float = 1.0, **more) -> Robot:
    """A block of 1 kg that slides on one of 2 kg, which slides on the floor; friction by the loads."""
    bearing = {"radial_arm": 1.0, "bending_arm": 1e9}  # guides so long that tipping loads nothing
    common = {"kind": "prismatic", "axis": (1.0, 0.0, 0.0), "bearing": bearing}
    return Robot.model_validate(
        {
            "name": "stack",
            "gravity": (0.0, 0.0, -GRAVITY),
            "links": [{"name": "below", "mass": 2.0}, {"name": "above", "mass": 1.0}],
            "joints": [
                {"name": "floor", "parent": "base", "child": "below", **common},
                {"name": "top", "parent": "below", "child": "above", "initial_velocity": velocity, **common},
            ],
            "effects": [on_load("floor", lower), on_load("top", upper)],
            "reference": {"duration": 2.0, "sample_rate": 200.0},
            **more,
        }
    )


def test_two_blocks_drag_each_other_and_stop_together() -> None:
    """The lower block is dragged along until both are equally fast; then the upper one sticks on it."""
    lower, upper = 0.05, 0.4
    recording = exact(stacked(lower, upper))
    g, time = GRAVITY, recording.time
    dragged = g * (upper * 1 - lower * 3) / 2
    meet = 1.0 / (g * upper + dragged)
    together = dragged * meet
    stop = meet + together / (g * lower)
    floor = np.where(time < meet, dragged * time, np.clip(together - g * lower * (time - meet), 0, None))
    relative = np.clip(1.0 - (g * upper + dragged) * time, 0, None)
    np.testing.assert_allclose(recording["floor.velocity"], floor, atol=1e-8)
    np.testing.assert_allclose(recording["top.velocity"], relative, atol=1e-8)
    np.testing.assert_array_equal(recording["top.sticking"], time >= meet)
    np.testing.assert_array_equal(recording["floor.sticking"], time >= stop)
    riding = (time > meet) & (time < stop)
    # What holds the upper block is what brakes it with the lower one, less than it could be.
    np.testing.assert_allclose(recording["top.friction_torque"][riding], -lower * g, rtol=1e-7)


def test_a_lower_block_that_cannot_be_dragged_stays() -> None:
    recording = exact(stacked(0.15, 0.4))
    np.testing.assert_array_equal(recording["floor.position"], 0.0)
    stop = 1.0 / (0.4 * GRAVITY)
    assert recording["top.position"][-1] == pytest.approx(stop / 2, abs=1e-8)
    sliding = recording.time < stop
    np.testing.assert_allclose(recording["floor.friction_torque"][sliding], 0.4 * GRAVITY * -1.0, rtol=1e-8)


def test_joints_that_stop_simultaneously_both_stop() -> None:
    data = stacked(0.1, 0.1).model_dump()
    for joint in data["joints"]:
        joint["parent"], joint["initial_velocity"] = "base", 1.0
    data["effects"] = [on_load("floor", 0.2), on_load("top", 0.2)]
    recording = exact(Robot.model_validate(data))
    stop = 1.0 / (0.2 * GRAVITY)
    for name in ("floor", "top"):
        assert recording[f"{name}.position"][-1] == pytest.approx(stop / 2, abs=1e-8)
        np.testing.assert_array_equal(recording[f"{name}.sticking"], recording.time >= stop)


def arm(**more) -> Robot:
    """Two links in a vertical plane, driven by small multisines so that joints stick again and again."""
    waves = {"kind": "multisine", "amplitudes": (0.2, 0.1), "frequencies": (0.5, 1.3), "ramp": 0.5}
    body = {"mass": 2.0, "center_of_mass": (0.3, 0.0, 0.0), "inertia": (0.01, 0.08, 0.08)}
    joint = {"axis": (0.0, 1.0, 0.0), "actuator": {}, "bearing": {"radial_arm": 0.05}}
    return Robot.model_validate(
        {
            "name": "arm",
            "gravity": (0.0, 0.0, -GRAVITY),
            "links": [{"name": "one", **body}, {"name": "two", **body}],
            "joints": [
                {"name": "shoulder", "parent": "base", "child": "one", **joint},
                {"name": "elbow", "parent": "one", "child": "two", "origin": (0.6, 0.0, 0.0), **joint},
            ],
            "controller": {"kind": "pd", "kp": 120.0, "kd": 4.0, "gravity_feedforward": True},
            "reference": {
                "duration": 2.0,
                "sample_rate": 2000.0,
                "joints": [{"joint": name, **waves} for name in ("shoulder", "elbow")],
            },
            "effects": [of_torque("shoulder", 3.0, 4.0, 0.05), of_torque("elbow", 1.0, 1.5, 0.05)],
            **more,
        }
    )


def test_energy_is_balanced_through_the_changes_of_mode() -> None:
    recording = exact(arm(), rtol=1e-10, atol=1e-12)
    power = sum(
        (recording[f"{name}.torque"] + recording[f"{name}.friction_torque"]) * recording[f"{name}.velocity"]
        for name in ("shoulder", "elbow")
    )
    changes = [np.sum(np.diff(recording[f"{name}.sticking"]) != 0) for name in ("shoulder", "elbow")]
    assert min(changes) >= 4
    work = np.concatenate([[0.0], np.cumsum((power[1:] + power[:-1]) / 2 / 2000.0)])
    energy = recording["robot.energy"] - recording["robot.energy"][0]
    # The trapezoids' error: h^2/12 of the change of the power's slope, about 1e3 W/s at every stop.
    np.testing.assert_allclose(energy, work, atol=1e-4)
    heat = sum(recording[f"{n}.friction_torque"] * recording[f"{n}.velocity"] for n in ("shoulder", "elbow"))
    assert np.all(heat <= 0)


@pytest.mark.proof
def test_smoothed_friction_converges_to_exact_stiction(monkeypatch: pytest.MonkeyPatch) -> None:
    effects = [{"effect": "coulomb_friction", "at": "shoulder", "torque": 3.0}]
    effects.append(
        {"effect": "load_dependent_friction", "at": "elbow", "coefficient": 0.5, "gear_share": 0.02}
    )
    robot = arm(effects=effects)
    wanted = exact(robot)
    errors = []
    for transition in (1e-2, 1e-3, 1e-4):
        monkeypatch.setattr(acting, "TRANSITION", transition)
        smooth = simulate(robot, sensors=False)
        errors.append(np.abs(smooth["elbow.position"] - wanted["elbow.position"]).max())
    orders = np.log10(np.divide(errors[:-1], errors[1:]))
    # What a smoothed joint creeps while it should stick is in proportion to the transition: first order.
    assert np.all(np.abs(orders - 1) < 0.2), (errors, orders)


def test_a_sampled_controller_is_held_between_its_instants() -> None:
    """A force in steps: the block leaves at the first step above the static level and not before."""
    step, stiffness, speed = 0.05, 200.0, 0.05
    robot = block(
        on_load("slide", 0.3),
        controller={"kind": "pd", "kp": stiffness, "kd": 0.0, "sample_time": step},
        motion=[ramp("slide", speed, 1.0)],
        duration=1.0,
        rate=1000.0,
    )
    recording = exact(robot)
    needed = 0.3 * MASS * GRAVITY / (stiffness * speed)
    start = step * np.ceil(needed / step)
    np.testing.assert_array_equal(recording["slide.sticking"][recording.time < start - 1e-9], 1.0)
    force = stiffness * speed * start - 0.3 * MASS * GRAVITY
    first = (recording.time >= start) & (recording.time < start + step)
    wanted = force / MASS * (recording.time[first] - start) ** 2 / 2
    np.testing.assert_allclose(recording["slide.position"][first], wanted, atol=INTEGRATED)


def test_a_planar_arm_with_load_friction_at_rest_sticks() -> None:
    """Load-dependent levels of several joints at rest: gravity's torque against what the loads allow."""
    torque = MASS * GRAVITY * 0.3
    robot = arm(
        controller={"kind": "none"},
        effects=[of_torque("shoulder", 5 * torque), on_load("elbow", 7.0)],
        reference={"duration": 1.0, "sample_rate": 100.0},
    )
    recording = exact(robot)
    # The elbow carries 2 kg: up to 7 * 0.05 m * 19.62 N = 6.9 N m of friction against 5.9 N m of weight.
    assert recording["elbow.sticking"].all()
    np.testing.assert_allclose(np.abs(recording["elbow.friction_torque"]), torque, rtol=1e-9)


def test_inconsistent_modes_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sticking, "MOST_TRIALS", 1)  # sticking only, on a plane that is too steep for it
    with pytest.raises(InputError, match=r"at t = 0 s neither sticking nor sliding of slide agrees"):
        exact(block(on_load("slide", 0.3), tilt=0.5))


def test_a_diverging_loop_is_refused() -> None:
    effects = [on_load("shoulder", 1.0), on_load("elbow", 1.0)]
    data = arm(controller={"kind": "none"}, effects=effects).model_dump()
    for joint in data["joints"]:
        joint["initial_velocity"] = 3.0
        joint["bearing"] |= {"radial_arm": 3.0, "bending_arm": 0.1}
    with pytest.raises(InputError, match="do not settle at t = 0 s"):
        exact(Robot.model_validate(data))


def test_chattering_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sticking, "MOST_CHANGES", 3)
    robot = block(
        of_torque("slide", 0.5), velocity=1.0, rate=1.0, controller={"kind": "pd", "kp": 5e3, "kd": 0.0}
    )
    with pytest.raises(
        InputError, match="stick and slip alternate more than 3 times within two samples at t"
    ):
        exact(robot)


def test_compiled_code_gives_the_same_trajectory() -> None:
    robot = block(on_load("slide", 0.3), tilt=0.2, velocity=1.0)
    plain, compiled = exact(robot), exact(robot, compile_code=True)
    np.testing.assert_allclose(compiled["slide.position"], plain["slide.position"], rtol=0, atol=1e-12)
    np.testing.assert_array_equal(compiled["slide.sticking"], plain["slide.sticking"])
