"""Free runs: stick, agreement with the engine, derivatives, recovered numbers; refused refits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from missing_physics.diagnosis.free_run.numbers import REFERENCE_DELAY, adjustables, with_numbers
from missing_physics.diagnosis.free_run.problem import Trial
from missing_physics.diagnosis.free_run.run import Runner, simulate_recording
from missing_physics.diagnosis.free_run.step import ClosedLoop
from missing_physics.diagnosis.simulation.refit import refit
from reference_model.effects.catalogue import used_effects
from reference_model.simulation import simulate
from robot_model import (
    Actuator,
    ComputedTorque,
    EffectUse,
    InputError,
    Joint,
    JointPD,
    Link,
    MultiSine,
    Recording,
    Reference,
    Robot,
    VoltageServo,
)

SERVO = VoltageServo(gain=0.6, supply=7.4)
MOTOR = Actuator(rotor_inertia=0.0018, torque_constant=0.38, resistance=4.0)
GRAVITY = (0.0, 0.0, -9.80665)
WAVES = MultiSine(joint="joint1", amplitudes=(0.6, 0.4), frequencies=(0.5, 1.3), phases=(0.0, 0.0))
COULOMB = EffectUse(effect="coulomb_friction", at="joint1", torque=0.03)
VISCOUS = EffectUse(effect="viscous_friction", at="joint1", coefficient=0.01)
GEAR = EffectUse(effect="load_dependent_friction", at="joint1", coefficient=0.0, gear_share=0.2)
RESISTANCE = "joint1.resistance"


def pendulum(*effects: EffectUse, gain: float = 0.6, waves: MultiSine = WAVES, start: float = 0.0) -> Robot:
    """0.49 kg at 0.1 m on a servo, hanging down at 0."""
    return Robot(
        name="pendulum",
        gravity=GRAVITY,
        links=(Link(name="arm", mass=0.49, center_of_mass=(0.0, 0.0, -0.1)),),
        joints=(
            Joint(
                name="joint1",
                parent="base",
                child="arm",
                axis=(0.0, 1.0, 0.0),
                actuator=MOTOR,
                initial_position=start,
            ),
        ),
        controller=VoltageServo(gain=gain, supply=7.4),
        reference=Reference(duration=4.0, sample_rate=200.0, joints=(waves,)),
        effects=effects,
    )


def two_links(controller: JointPD | ComputedTorque) -> Robot:
    """A planar arm under gravity with friction in both joints."""
    links = tuple(
        Link(name=f"link{k}", mass=2.0, center_of_mass=(0.2, 0.0, 0.0), inertia=(0.01, 0.03, 0.03))
        for k in (1, 2)
    )
    joints = tuple(
        Joint(
            name=f"joint{k}",
            parent=parent,
            child=f"link{k}",
            axis=(0.0, 1.0, 0.0),
            origin=(0.4 if k == 2 else 0.0, 0.0, 0.0),
            actuator=Actuator(gear_ratio=50.0, rotor_inertia=1e-5),
        )
        for k, parent in ((1, "base"), (2, "link1"))
    )
    waves = tuple(
        MultiSine(joint=f"joint{k}", amplitudes=(0.5,), frequencies=(0.4 * k,), phases=(0.0,)) for k in (1, 2)
    )
    friction = tuple(
        EffectUse(effect="coulomb_friction", at=f"joint{k}", torque=torque)
        for k, torque in ((1, 2.0), (2, 1.0))
    )
    return Robot(
        name="arm",
        gravity=GRAVITY,
        links=links,
        joints=joints,
        controller=controller,
        reference=Reference(duration=3.0, sample_rate=500.0, joints=waves),
        effects=friction,
    )


def gap(robot: Robot, *, longest_step: float) -> float:
    """Largest difference of a free run from the engine's simulation at tight tolerance."""
    truth = simulate(robot, sensors=False, rtol=1e-9, atol=1e-11)
    run = simulate_recording(robot, truth, longest_step=longest_step)
    names = [f"{joint.name}.position" for joint in robot.moving_joints]
    return max(float(np.abs(run.recording[name] - truth[name]).max()) for name in names)


def held(angle: float, robot: Robot, seconds: float = 6.0) -> Recording:
    """A recording in which nothing but a constant reference is known."""
    time = np.linspace(0.0, seconds, int(190 * seconds))
    still = np.full(time.size, angle)
    return Recording(time, {"joint1.position": still, "joint1.reference_position": still})


@pytest.mark.parametrize(
    "effects",
    [
        (COULOMB, VISCOUS),
        (COULOMB, VISCOUS, GEAR),
        (
            EffectUse(
                effect="stribeck_friction",
                at="joint1",
                coulomb_torque=0.02,
                static_torque=0.03,
                stribeck_velocity=0.3,
            ),
        ),
        (VISCOUS, EffectUse(effect="actuator_lag", at="joint1", time_constant=0.02)),
        (VISCOUS, EffectUse(effect="payload", at="arm", mass=0.1, z=-0.1)),
    ],
    ids=lambda effects: "+".join(use.effect for use in effects),
)
def test_follows_the_engine(effects: tuple[EffectUse, ...]) -> None:
    # The engine smooths dry friction over 1e-4 rad/s and so creeps by up to 4e-4 rad in these 4 s; time
    # steps of
    # 1 ms add about 1e-4 rad. Wrong friction or a missing term shows as 1e-2 rad and more.
    assert gap(pendulum(*effects), longest_step=1e-3) < 6e-4


@pytest.mark.parametrize(
    "controller",
    [
        JointPD(kp=800.0, kd=40.0, ki=100.0, gravity_feedforward=True),
        ComputedTorque(kp=400.0, kd=40.0),
        JointPD(kp=200.0, kd=8.0, sample_time=0.004),
    ],
    ids=["pd", "computed_torque", "sampled"],
)
def test_follows_the_engine_with_two_joints(controller: JointPD | ComputedTorque) -> None:
    # Tracking errors are about 1e-2 rad here; what is left is the engine's smoothed stick and the steps.
    assert gap(two_links(controller), longest_step=1e-3) < 2e-4


def test_smooth_motion_converges_with_second_order() -> None:
    robot = pendulum(VISCOUS)
    steps = (5e-3, 2.5e-3)
    # The reference is interpolated linearly between samples of 5 ms whatever the step, so the limit is
    # another
    # run with tiny steps, not the engine.
    truth = simulate(robot, sensors=False)
    fine = simulate_recording(robot, truth, longest_step=1e-4).recording["joint1.position"]
    errors = [
        np.abs(simulate_recording(robot, truth, longest_step=h).recording["joint1.position"] - fine).max()
        for h in steps
    ]
    # Exactly 4 for small steps; a first-order scheme gives 2.
    assert 3.5 < errors[0] / errors[1] < 4.5


@pytest.mark.parametrize("step", [1e-3, 5e-3])
def test_a_stuck_joint_does_not_move_at_all(step: float) -> None:
    robot = pendulum(EffectUse(effect="coulomb_friction", at="joint1", torque=0.3))
    recording = held(0.5, robot)  # gravity pulls with 0.23 N m, less than 0.3
    run = simulate_recording(robot, recording, longest_step=step)
    np.testing.assert_array_equal(run.recording["joint1.position"], 0.5)
    np.testing.assert_array_equal(run.recording["joint1.velocity"], 0.0)


def test_load_dependent_friction_holds_where_statics_say() -> None:
    # The motor starts with zero torque at its reference, and gains k per rad as the arm sinks by x; it
    # sticks once
    # m g l sin(q) - k x <= torque + share k x. Inertia may carry it further, never less far.
    robot = pendulum(COULOMB, GEAR, VISCOUS)
    stiffness = 0.6 * 7.4 * 0.38 / 4.0
    run = simulate_recording(robot, held(0.5, robot)).recording
    q, load = run["joint1.position"][-1], 0.49 * 9.80665 * 0.1
    assert run["joint1.velocity"][-1] == 0.0
    drive = stiffness * (0.5 - q)
    assert abs(load * np.sin(q) - drive) <= 0.03 + 0.2 * abs(drive) + 1e-12
    assert q < 0.5 - 0.1


def test_sticking_is_not_biased() -> None:
    """Mirrored motions give mirrored runs."""
    robot = pendulum(COULOMB, GEAR, VISCOUS)
    truth = simulate(robot, sensors=False)
    mirrored = replace(truth, channels={name: -values for name, values in truth.channels.items()})
    one, other = (simulate_recording(robot, r).recording["joint1.position"] for r in (truth, mirrored))
    # The Newton passes may take the two directions in another order, so rounding differs.
    np.testing.assert_allclose(one, -other, atol=1e-9)


def test_without_the_drive_the_arm_swings_freely() -> None:
    robot = pendulum()
    recording = held(0.1, robot, seconds=3.0)
    off = recording.with_channels({"joint1.reference_position": np.full(len(recording), np.nan)})
    q = simulate_recording(robot, off).recording["joint1.position"]
    inertia = 0.49 * 0.1**2 + 0.0018
    omega = np.sqrt(0.49 * 9.80665 * 0.1 / inertia) * (1 - 0.1**2 / 16)
    # Pendulum period to second order in the amplitude, whose next term is 1e-6 of the phase; the midpoint
    # rule
    # lags by (omega h)^2/24 of the phase, 1.5e-5 of 25 rad.
    np.testing.assert_allclose(q, 0.1 * np.cos(omega * off.time), atol=3e-4)


def test_measured_supply_scales_the_voltage() -> None:
    robot = pendulum(VISCOUS)
    truth = simulate(robot, sensors=False)
    low = truth.with_channels({"supply.voltage": np.full(len(truth), 5.0)})
    one = simulate_recording(robot, low).recording["joint1.position"]
    other = simulate_recording(robot, truth, controller=VoltageServo(gain=0.6, supply=5.0)).recording
    np.testing.assert_allclose(one, other["joint1.position"], atol=1e-12)  # the same numbers, other rounding


def test_derivatives_are_those_of_the_run() -> None:
    effects = (COULOMB, VISCOUS, GEAR, EffectUse(effect="sensor_offset", at="joint1.position", offset=0.01))
    robot = pendulum(*effects)
    names = (
        "coulomb_friction@joint1.torque",
        "load_dependent_friction@joint1.gear_share",
        "sensor_offset@joint1.position.offset",
        "joint1.torque_constant",
        RESISTANCE,
        "joint1.rotor_inertia",
        "arm.center_of_mass.x",
        "controller.supply",
        REFERENCE_DELAY,
    )
    recording = simulate(robot, sensors=False).window(0.0, 2.0)
    runner, loop = Runner(robot, recording), ClosedLoop(robot, names)
    _, slopes = runner.positions(loop)
    for column, name in enumerate(names):
        number = adjustables(robot)[name]
        step = 1e-6 * number.typical
        ends = [runner.positions(loop, {name: number.value + s * step})[0] for s in (1, -1)]
        finite = (ends[0] - ends[1]) / (2 * step)
        size = np.abs(finite).max()
        assert size > 0
        # Differences cross a step in which the joint begins or ends to stick now and then, where the run has
        # a kink.
        close = np.abs(slopes[:, :, column] - finite) < 1e-4 * size
        assert close.mean() > 0.98, name


TRAINED = ("coulomb_friction@joint1.torque", "viscous_friction@joint1.coefficient", RESISTANCE)


def noisy(robot: Robot, seed: int) -> Trial:
    """A recording of the robot with the noise and the steps of a coarse encoder, and its controller."""
    true = simulate(robot, sensors=False)
    step = 2 * np.pi / 4096
    noise = np.random.default_rng(seed).normal(0.0, step / 3, len(true))
    said = np.round((true["joint1.position"] + noise) / step) * step
    channels = {"joint1.position": said, "joint1.reference_position": true["joint1.reference_position"]}
    return Trial(Recording(true.time, channels, f"log {seed}"), robot.controller)  # type: ignore[arg-type]


OTHER = MultiSine(joint="joint1", amplitudes=(0.8,), frequencies=(0.7,), phases=(0.0,))


def test_recovers_what_made_the_recordings() -> None:
    true = pendulum(COULOMB, VISCOUS)
    trials = [noisy(pendulum(COULOMB, VISCOUS, gain=g), k) for k, g in enumerate((0.3, 1.2))]
    held_out = [noisy(pendulum(COULOMB, VISCOUS, waves=OTHER), 7)]
    wrong = with_numbers(true, {TRAINED[0]: 0.01, TRAINED[1]: 0.02, RESISTANCE: 5.0})
    done = refit(wrong, trials, held_out, free=TRAINED, starts=2)
    assert done.accepted
    assert not done.at_bound
    for name in TRAINED:
        truth = adjustables(true)[name].value
        # An encoder step of 1.5e-3 rad is 0.5 % of the lag that these numbers make.
        assert done.parameters[name].value == pytest.approx(truth, rel=0.03), name
        assert adjustables(done.robot)[name].value == pytest.approx(done.parameters[name].value)
    before, after = done.held_out["log 7"]["joint1"]
    assert after.rms < 0.2 * before.rms


def test_keeps_what_was_when_held_out_runs_do_not_gain() -> None:
    # The held-out recording comes from the robot as given, so whatever the others teach makes it worse.
    robot = pendulum(COULOMB, VISCOUS)
    changed = pendulum(COULOMB.model_copy(update={"torque": 0.06}), VISCOUS)
    done = refit(robot, [noisy(changed, 1)], [noisy(pendulum(COULOMB, VISCOUS, waves=OTHER), 2)], starts=1)
    assert not done.accepted
    assert done.robot == robot
    before, after = done.training["log 1"]["joint1"]
    assert after.rms < before.rms


def test_says_which_numbers_the_runs_do_not_depend_on() -> None:
    robot = pendulum(COULOMB, VISCOUS, GEAR)
    changed = pendulum(COULOMB, VISCOUS, GEAR.model_copy(update={"gear_share": 0.4}))
    done = refit(robot, [noisy(changed, 1)], [noisy(changed, 2)], starts=1)
    assert done.without_information == ("load_dependent_friction@joint1.coefficient",)  # there is no bearing
    assert done.parameters["load_dependent_friction@joint1.gear_share"].value == pytest.approx(0.4, abs=0.02)


def test_friction_at_rest_is_never_refitted_below_that_of_sliding() -> None:
    """What slides as viscous friction asks, beyond Stribeck's speed, would have a law that falls below it."""
    law = {"coulomb_torque": 0.02, "static_torque": 0.022, "stribeck_velocity": 5.0}
    start = EffectUse.model_validate({"effect": "stribeck_friction", "at": "joint1", **law})
    robot, true = pendulum(start), pendulum(VISCOUS)
    held_out = [noisy(pendulum(VISCOUS, waves=OTHER), 2)]
    done = refit(robot, [noisy(true, 1)], held_out, starts=1)
    assert done.accepted
    rest, sliding = (
        done.parameters[f"stribeck_friction@joint1.{name}_torque"].value for name in ("static", "coulomb")
    )
    assert rest >= sliding > 0.02
    [used] = used_effects(done.robot)  # such a robot can be run
    assert used.parameters["static_torque"] == pytest.approx(rest)


def test_of_two_numbers_in_order_one_alone_lifts_the_other() -> None:
    law = {"coulomb_torque": 0.02, "static_torque": 0.03, "stribeck_velocity": 0.1}
    robot = pendulum(EffectUse.model_validate({"effect": "stribeck_friction", "at": "joint1", **law}))
    changed = with_numbers(robot, {"stribeck_friction@joint1.coulomb_torque": 0.05})
    [used] = used_effects(changed)
    assert used.parameters["static_torque"] == used.parameters["coulomb_torque"] == 0.05


def test_unusable_input_is_refused() -> None:
    robot = pendulum(COULOMB)
    recording = held(0.5, robot)
    with pytest.raises(InputError, match="did you mean"):
        ClosedLoop(robot, ("joint1.resistanse",))
    with pytest.raises(InputError, match="no channel"):
        simulate_recording(robot, Recording(recording.time, {}))
    with pytest.raises(InputError, match="hold out"):
        refit(robot, [Trial(recording)], [])
    floating = robot.model_copy(update={"base": robot.base.model_copy(update={"kind": "free", "mass": 1.0})})
    with pytest.raises(InputError, match="fixed base"):
        ClosedLoop(floating)
