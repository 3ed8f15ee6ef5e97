"""Data coverage, reported before any fit for each joint, with advice."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from diagnosis_cases import ARM, Sines, bare, recorded

from missing_physics.coverage import Coverage, coverage, prepared
from missing_physics.coverage.contradictions import contradictions
from missing_physics.motion.recorded import make_dynamics
from robot_model import Actuator, InputError, Recording, Robot

ROBOT = bare("two_link_arm", noise=True)


def judged(
    *recordings: Recording,
    robot: Robot = ROBOT,
    validation: Sequence[Recording] = (),
    cutoff: float | None = None,
) -> Coverage:
    ready = prepared(robot, [*recordings, *validation], cutoff=cutoff)
    return coverage(robot, ready.recordings, ready.dynamics, fitted=len(recordings), dead=ready.dead)


def kinds(found: Coverage) -> dict[str, str]:
    """Kind of the reason for each joint that cannot be judged."""
    return {joint.name: joint.reason.kind for joint in found.joints if joint.reason is not None}


def renamed(made: Recording, quantity: str) -> Recording:
    """Torques under the name of another quantity."""
    return Recording(made.time, {k.replace("torque", quantity): v for k, v in made.channels.items()})


def test_informative_motion_gives_no_coverage_message() -> None:
    found = judged(recorded(ROBOT, ARM, seed=1))
    assert found.enough
    assert found.sentences == ()
    assert kinds(found) == {}


def test_short_recording_is_rejected_with_the_required_duration() -> None:
    found = judged(recorded(ROBOT, ARM, seed=1, duration=3.0), cutoff=2.5)
    assert not found.enough
    [sentence] = found.sentences
    # two times 40 rows at four per period of the cut-off
    assert sentence.endswith("cut-off of 2.5 Hz; record at least 8 s more.")
    assert sentence.startswith("only ")


def test_joint_without_torque_is_reported_and_others_are_still_diagnosed() -> None:
    made = recorded(ROBOT, ARM, seed=1)
    channels = {k: v for k, v in made.channels.items() if k != "joint2.torque"}
    found = judged(Recording(made.time, channels))
    assert found.enough
    assert kinds(found) == {"joint2": "no_torque"}
    [sentence] = found.sentences
    assert sentence.startswith("joint2: no torque, current or voltage is recorded")


def test_missing_torque_of_all_joints_is_reported_once() -> None:
    made = recorded(ROBOT, ARM, seed=1)
    found = judged(Recording(made.time, {k: v for k, v in made.channels.items() if "position" in k}))
    assert not found.enough
    [sentence] = found.sentences
    assert sentence.startswith("joint1 and joint2: no torque, current or voltage is recorded")


def test_two_encoders_suffice_to_diagnose_the_gear_without_torque() -> None:
    made = recorded(ROBOT, ARM, seed=1)
    channels = {k: v for k, v in made.channels.items() if "position" in k}
    both = {**channels, "joint1.motor_position": channels["joint1.position"]}
    found = judged(Recording(made.time, both))
    assert [s.split(", so ")[1].split(" can")[0] for s in found.sentences] == [
        "only the gear between motor and joint",
        "nothing there",
    ]


@pytest.mark.parametrize(
    ("quantity", "given", "named"),
    [
        ("current", {}, ["torque_constant [N m/A]"]),
        ("voltage", {}, ["torque_constant [N m/A]", "resistance [ohm]"]),
        ("voltage", {"torque_constant": 0.1}, ["resistance [ohm]"]),
        ("voltage", {"resistance": 2.0}, ["torque_constant [N m/A]"]),
    ],
)
def test_missing_key_is_reported_once(quantity: str, given: dict[str, float], named: list[str]) -> None:
    robot = ROBOT.model_copy(
        update={"joints": tuple(j.model_copy(update={"actuator": Actuator(**given)}) for j in ROBOT.joints)}
    )
    found = judged(renamed(recorded(ROBOT, ARM, seed=1), quantity), robot=robot)
    [sentence] = found.sentences
    assert sentence.startswith(f"joint1 and joint2: the motor's {quantity} is recorded")
    assert sentence.endswith(f"add {' and '.join(named)} to the joint's actuator.")
    lacking = {key.split(" ")[0] for key in named}
    assert not {"torque_constant", "resistance"} - lacking & {word.strip(",;") for word in sentence.split()}


def test_joint_at_rest_is_reported() -> None:
    resting = replace(ARM[1], amplitudes=(0.0, 0.0, 0.0))
    found = judged(recorded(ROBOT, (ARM[0], resting), seed=1))
    assert found.enough
    assert kinds(found) == {"joint2": "no_motion"}
    assert found.sentences[0].startswith("joint2: no motion beyond the noise of the position")


def test_motion_in_one_direction_cannot_distinguish_friction_from_an_offset() -> None:
    made = recorded(ROBOT, ARM, seed=1)
    slow = Sines((0.02,), (0.3,), (0.0,))
    time = made.time
    ramp = made.with_channels({"joint2.position": 0.2 * time + slow(time)[0]})
    found = judged(ramp)
    assert found.enough
    assert len(found.sentences) == 1
    assert found.sentences[0].startswith("joint2 moves in one direction only")
    every = judged(ramp.with_channels({"joint1.position": 0.3 * time + slow(time)[0]}))
    [sentence] = every.sentences
    assert sentence.startswith("joint1 and joint2 move in one direction only")
    # a second recording in the other direction corrects it
    back = ramp.with_channels({"joint2.position": -np.asarray(ramp["joint2.position"])})
    both = judged(ramp, back)
    assert both.enough
    assert both.sentences == ()


#: A balanced link, so that only motion takes a torque.
AXIS = bare("two_link_arm", noise=False).model_copy(update={"gravity": (0.0, 0.0, 0.0)})
DEGREE = np.pi / 180.0


def hardly(position: np.ndarray, *, step: float, torque_noise: float = 0.05) -> Recording:
    """Both joints move by `position`, read in steps; the torques hold nothing but noise."""
    chance = np.random.default_rng(1)
    time = np.arange(position.size) / 250.0
    channels = {}
    for joint in ("joint1", "joint2"):
        read = position + 0.2 * step * chance.standard_normal(time.size)
        channels[f"{joint}.position"] = np.round(read / step) * step
        channels[f"{joint}.torque"] = torque_noise * chance.standard_normal(time.size)
    return Recording(time, channels, "hardly.csv")


TIME = np.arange(5000) / 250.0


@pytest.mark.parametrize(
    ("position", "step", "kind"),
    [
        (0.4 * DEGREE * np.sin(2 * np.pi * 0.02 * TIME), 1e-6, "all_noise"),
        (0.4 * DEGREE * np.sign(np.sin(2 * np.pi * 0.2 * TIME)), 1.5e-3, "little_motion"),
        (0.4 * DEGREE * np.tanh((TIME - 10.0) / 0.3), 1e-5, "rests_held_out"),
        (0.01 * DEGREE * np.sin(2 * np.pi * 0.2 * TIME), 1.5e-3, "no_motion"),
    ],
    ids=["slow", "coarse", "once", "not at all"],
)
def test_joint_with_very_small_motion_is_not_diagnosed(position: np.ndarray, step: float, kind: str) -> None:
    found = judged(hardly(position, step=step), robot=AXIS)
    assert not found.enough
    assert kinds(found) == {"joint1": kind, "joint2": kind}


def test_small_motion_with_sufficient_torque_is_diagnosed() -> None:
    small = 0.4 * DEGREE * np.sin(2 * np.pi * 0.5 * TIME)
    quiet = hardly(small, step=1e-6, torque_noise=1e-4)
    assert judged(quiet, robot=AXIS).enough
    # a torque beyond the noise that the robot file does not account for is something to judge, too
    rubbing = {
        f"{joint}.torque": quiet[f"{joint}.torque"] + 0.5 * np.sign(np.cos(2 * np.pi * 0.5 * TIME))
        for joint in ("joint1", "joint2")
    }
    assert judged(quiet.with_channels(rubbing), robot=AXIS).enough


def test_second_recording_with_motion_suffices_for_validation() -> None:
    chirp = 0.5 * np.sin(2 * np.pi * (0.2 + 0.02 * TIME) * TIME)
    once = np.where(np.abs(TIME - 10.0) < 1.0, chirp, chirp[np.searchsorted(TIME, 9.0)])
    once = np.where(TIME >= 11.0, chirp[np.searchsorted(TIME, 11.0)], once)
    first, second = hardly(once, step=1e-6), hardly(chirp, step=1e-6)
    assert kinds(judged(first, robot=AXIS)) == {"joint1": "rests_held_out", "joint2": "rests_held_out"}
    assert judged(first, robot=AXIS, validation=[second]).enough
    still = judged(second, robot=AXIS, validation=[hardly(0.0 * TIME, step=1e-6)])
    assert not still.enough
    assert "give a recording with --validate in which the joint moves" in still.sentences[0]


SWING = bare("two_link_arm", noise=False)


def swinging(**torques: np.ndarray) -> Recording:
    """What the arm does with these torques recorded, by joint, in the place of its own."""
    made = recorded(SWING, ARM)
    return made.with_channels({f"{joint}.torque": y for joint, y in torques.items()})


@pytest.mark.parametrize("value", [0.0, 3.7])
def test_constant_torque_of_a_driven_joint_is_reported_as_a_dead_channel(value: float) -> None:
    made = swinging(joint2=np.full(3000, value))
    ready = prepared(SWING, [made])
    assert set(ready.dead) == {"joint2.torque"}
    assert "joint2.torque" not in ready.recordings[0]
    assert np.isnan(ready.dynamics[0].motion.torque[:, 1]).all()
    found = judged(made, robot=SWING)
    assert kinds(found) == {"joint2": "dead"}
    assert f"joint2.torque is {value:g} throughout" in found.sentences[0]
    # who knows better can insist
    assert prepared(SWING, [made], as_recorded=True).recordings[0] is made


def test_passive_joint_with_zero_torque_has_no_dead_channel() -> None:
    """Friction and gravity make its motion, whatever its mass: its torque is nothing, and known."""
    time = np.arange(3000) / 250.0
    decay = 0.3 * np.exp(-0.1 * time) * np.cos(4.0 * time)
    free = Recording(time, {"joint1.position": decay, "joint1.torque": np.zeros(3000)}, "free.csv")
    robot = bare("single_axis").model_copy(update={"gravity": (0.0, 0.0, -9.81)})
    assert prepared(robot, [free]).dead == {}
    assert judged(free, robot=robot).enough


def test_short_circuited_motor_is_not_reported_as_a_reversed_channel() -> None:
    """Its back-EMF takes power from the motion; a factor of a voltage of nothing corrects nothing."""
    motor = Actuator(gear_ratio=100.0, torque_constant=0.1, resistance=2.0)
    robot = SWING.model_copy(
        update={"joints": tuple(j.model_copy(update={"actuator": motor}) for j in SWING.joints)}
    )
    made = renamed(recorded(SWING, ARM), "voltage")
    unplugged = made.with_channels({"joint2.voltage": np.zeros(len(made))})
    (along,) = make_dynamics(robot, [unplugged])
    assert [f.channel for f in contradictions(robot, unplugged, along) if "joint2" in f.channel] == []
    assert kinds(judged(unplugged, robot=robot))["joint2"] == "dead"


def test_missing_samples_are_reported_with_channel_time_and_length() -> None:
    made = recorded(ROBOT, ARM, seed=1)
    lost = np.where((made.time > 4.0) & (made.time < 6.0), np.nan, made["joint2.torque"])
    ready = prepared(ROBOT, [made.with_channels({"joint2.torque": lost})])
    assert ready.recordings[0].time[0] == pytest.approx(6.0)
    assert len(ready.recordings[0]) == 1500
    [sentence] = coverage(ROBOT, ready.recordings, ready.dynamics, fitted=1).sentences
    assert sentence.startswith(
        "made by formula: only 1500 of 3000 samples are used, those from 6 to 11.996 s"
    )
    assert "joint2.torque has no number between 4 and 6 s" in sentence


def test_time_gap_is_reported_and_splits_the_recording() -> None:
    made = recorded(ROBOT, ARM, seed=1)
    later = Recording(np.where(made.time < 7.0, made.time, made.time + 1e6), made.channels, "log.csv")
    ready = prepared(ROBOT, [later])
    assert ready.recordings[0].duration == pytest.approx(7.0, abs=0.01)
    [sentence] = coverage(ROBOT, ready.recordings, ready.dynamics, fitted=1).sentences
    assert "no sample was recorded between 6.996 and 1.00001e+06 s" in sentence


def test_late_start_and_several_gaps_of_a_channel_are_reported() -> None:
    made = recorded(ROBOT, ARM, seed=1)
    t = made.time
    late = np.where(t < 1.0, np.nan, made["joint1.torque"])
    late[(t > 2.0) & (t < 2.5)] = np.nan
    late[(t > 3.0) & (t < 3.2)] = np.nan
    [sentence] = judged(made.with_channels({"joint1.torque": late})).sentences
    assert "joint1.torque has no number between 0 and 1 s" in sentence
    assert "between 2 and 2.5 s, and 1 more gap" in sentence
    few = np.where(np.isin(np.arange(len(t)), [5, 900]), 1.0, np.nan)
    with pytest.raises(InputError, match=r"joint1\.torque has a number in 2 of 3000 samples"):
        prepared(ROBOT, [made.with_channels({"joint1.torque": few})])


def test_few_missing_samples_are_interpolated_without_a_message() -> None:
    made = recorded(ROBOT, ARM, seed=1)
    lost = np.where((made.time > 4.0) & (made.time < 4.03), np.nan, made["joint2.torque"])
    holed = made.with_channels({"joint2.torque": lost})
    assert judged(holed).sentences == ()
    assert prepared(ROBOT, [holed]).recordings[0] is holed


def test_encoder_flickering_between_steps_counts_as_rest() -> None:
    chance = np.random.default_rng(3)
    made = recorded(ROBOT, ARM, seed=1)
    rests = 1e-3 * chance.integers(0, 3, len(made))
    assert kinds(judged(made.with_channels({"joint2.position": rests}))) == {"joint2": "no_motion"}


def test_reversals_exclude_few_samples_of_a_small_motion() -> None:
    """Less than a tenth of the samples of a motion that reverses every 1.7 s."""
    swing = hardly(0.05 * np.sin(2 * np.pi * 0.3 * TIME), step=1e-6, torque_noise=1e-4)
    drift = hardly(0.05 * TIME, step=1e-6, torque_noise=1e-4)
    (reverses, _), (runs, _) = (judged(one, robot=AXIS).joints for one in (swing, drift))
    assert 0.9 * runs.sure[0] < reverses.sure[0] < runs.sure[0]
