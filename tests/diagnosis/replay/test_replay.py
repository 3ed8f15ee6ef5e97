"""Runs in closed loop along recordings: what they leave, and what is not run."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from end_to_end_cases import ARM, AXIS, FRICTION, otherwise, shortened

from missing_physics.diagnosis.replay.replay import KNOWN, Replay, _heavier, _otherwise
from missing_physics.diagnosis.replay.sensor_errors import as_measured, dear, difference, known_noise
from missing_physics.diagnosis.runs.energies import left_in_runs
from reference_model.simulation import simulate
from robot_model import (
    Cycloid,
    EffectUse,
    MultiSine,
    NoController,
    Robot,
    Table,
)


@pytest.mark.parametrize("robot", [AXIS, ARM], ids=["axis", "arm"])
def test_a_robot_that_lacks_nothing_leaves_its_sensors_noise(robot: Robot) -> None:
    """Along a reference that only the recording holds."""
    recording = simulate(otherwise(robot), seed=10)
    replay = Replay.of(robot, [recording])
    assert replay is not None
    energies = replay.energies(robot, 0)
    assert energies is not None
    # a mean of N squares of standard normal numbers scatters by sqrt(2 / N); five of those
    assert np.abs(energies - 1).max() < 5 * np.sqrt(2 / len(recording))
    missing = replay.energies(robot.with_effects(FRICTION), 0)
    assert missing is not None
    assert missing.max() > 10


ERRORS = {
    "offset": EffectUse(effect="sensor_offset", at="joint1.position", offset=2e-3),
    "disc": EffectUse(effect="encoder_eccentricity", at="joint1.position", cosine=2e-3, sine=1e-3, order=4.0),
    "delay": EffectUse(effect="sensor_delay", at="joint1.position", delay=2e-3),
}


@pytest.mark.parametrize("error", ERRORS)
def test_a_robot_begins_where_it_is_described_whatever_its_encoder_says(error: str) -> None:
    """And elsewhere where its encoder, with its own error undone, says so."""
    faulty = ARM.with_effects(ERRORS[error])
    moved = tuple(
        j.model_copy(update={"initial_position": j.initial_position + 0.05}) if j.name == "joint1" else j
        for j in faulty.joints
    )
    for real in (faulty, faulty.model_copy(update={"joints": moved})):
        recording = simulate(real, seed=12)
        replay = Replay.of(ARM, [recording])
        assert replay is not None
        energies = replay.energies(faulty, 0)
        assert energies is not None
        if real is faulty:
            # as above
            assert np.abs(energies - 1).max() < 5 * np.sqrt(2 / len(recording))
        else:  # a noisy first sample is all that tells where it began
            described = replay.energies(ARM, 0)
            assert described is not None
            assert energies.max() < described.max()


def test_late_samples_show_the_command_that_was_in_force() -> None:
    """A command is new at its instant, however time stamps are rounded: before it, it is a sample older."""
    like = AXIS.controller.model_copy(update={"sample_time": 1e-3})
    reference = AXIS.reference
    assert reference is not None
    reference = reference.model_copy(update={"duration": 16.0, "sample_rate": 1000.0})
    noise = {"joint1.position": 1e-6, "joint1.torque": 1e-2}
    quiet = tuple(s.model_copy(update={"noise": noise[s.channel]}) for s in AXIS.sensors)
    robot = AXIS.model_copy(update={"controller": like, "reference": reference, "sensors": quiet})
    recording = simulate(robot, seed=3)
    recording = replace(recording, time=np.round(recording.time, 9))  # as a file has it
    replay = Replay.of(robot, [recording])
    assert replay is not None
    energies = replay.energies(robot, 0)
    assert energies is not None
    assert np.abs(energies - 1).max() < 5 * np.sqrt(2 / len(recording))


def brief(name: str, *, held: float = 0.0, duration: float = 1.0) -> Robot:
    """The beginning of a shipped robot's motion; with `held` under a sampled controller."""
    robot = shortened(name, duration=duration, rate=200.0)
    controller = robot.controller.model_copy(update={"sample_time": held})
    return robot.model_copy(update={"controller": controller})


DEAR = {
    "bending": brief("flexible_space_robot_planar", duration=3.0),
    "bending, sampled": brief("flexible_space_robot", held=2e-3, duration=0.5),
    "six joints": brief("six_joint_space_arm"),
    "six joints, sampled": brief("six_joint_space_arm", held=2e-3),
}


@pytest.mark.proof
@pytest.mark.parametrize("case", DEAR)
def test_runs_at_coarse_tolerances_err_by_less_than_a_tenth_of_the_noise(case: str) -> None:
    """Rest and reversals under more friction than the robot file knows; against fine tolerances."""
    robot = DEAR[case].with_effects(FRICTION.model_copy(update={"torque": 0.5}))
    assert dear(robot)
    exact = robot.model_copy(
        update={
            "sensors": tuple(s.model_copy(update={"noise": 0.0, "resolution": 0.0}) for s in robot.sensors)
        }
    )
    right = simulate(exact, rtol=1e-8, atol=1e-10)
    found = as_measured(robot)
    for sensor in robot.sensors:
        if known_noise(sensor):
            error = difference(sensor, right[sensor.channel], found[sensor.channel])
            assert np.sqrt(np.mean(error**2)) < 0.1, sensor.channel


def test_accelerations_of_a_recorded_reference_with_kinks_are_its_own() -> None:
    """Computed torque feeds them forward; a move that begins and ends has kinks in them."""
    robot = shortened("flexible_space_robot_planar", duration=6.0, rate=200.0)
    robot = robot.model_copy(update={"effects": ()})
    moves = [
        tuple(
            Cycloid(joint=j.name, displacement=way, start=0.31, duration=5.0)
            for j, way in zip(robot.moving_joints, ways)
        )
        for ways in ((0.4, 0.2), (-0.8, -1.5))
    ]
    assert robot.reference is not None
    there, elsewhere = (
        robot.model_copy(update={"reference": robot.reference.model_copy(update={"joints": joints})})
        for joints in moves
    )
    replay = Replay.of(there, [simulate(elsewhere, seed=12)])
    assert replay is not None
    energies = replay.energies(there, 0)
    assert energies is not None
    # a mean of 1200 squares scatters by 0.04, and runs err by a tenth of the noise
    assert energies.max() < 1.2


@pytest.mark.parametrize("case", [pytest.param("bending", marks=pytest.mark.proof), "six joints"])
def test_robots_that_are_dear_to_run_leave_their_sensors_noise(case: str) -> None:
    """Along the file's own reference, and along one that only the recording holds."""
    robot = DEAR[case]
    recordings = [simulate(swaying(robot, 0.3), seed=18), simulate(robot, seed=18)]
    replay = Replay.of(robot, recordings)
    assert replay is not None
    assert [any(isinstance(j, Table) for j in a.robot.reference.joints) for a in replay.asked] == [
        True,
        False,
    ]
    for which in (0, 1):
        energies = replay.energies(robot, which)
        assert energies is not None
        # as above, with the hundredth that coarse tolerances may leave
        assert np.abs(energies - 1).max() < 5 * np.sqrt(2 / len(recordings[0])) + 0.01
        missing = replay.energies(robot.with_effects(FRICTION), which)
        assert missing is not None
        assert missing.max() > 10


def swaying(robot: Robot, frequency: float) -> Robot:
    """The robot with its first joint swaying and all others at rest."""
    sway = MultiSine(
        joint=robot.moving_joints[0].name, amplitudes=(0.05,), frequencies=(frequency,), ramp=2.0
    )
    assert robot.reference is not None
    return robot.model_copy(update={"reference": robot.reference.model_copy(update={"joints": (sway,)})})


def test_a_long_recording_of_a_dear_robot_is_not_run() -> None:
    robot = DEAR["bending"]
    recording = simulate(robot, seed=19)
    long = tuple(
        replace(
            recording,
            time=np.arange(40_000) / 1000.0,
            channels={k: np.resize(v, 40_000) for k, v in recording.channels.items()},
        )
        for _ in range(2)
    )
    assert Replay.of(robot, [recording]) is not None
    assert Replay.of(robot, long) is None
    often = robot.controller.model_copy(update={"sample_time": 1e-5})
    assert Replay.of(robot.model_copy(update={"controller": often}), [recording]) is None


@pytest.mark.parametrize(("held", "long"), [(0.0, False), (2e-3, True)])
def test_runs_of_many_small_steps_count_as_several(
    held: float, long: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where a sampled controller keeps a joint at rest each command takes implicit steps of its own."""
    monkeypatch.setattr("missing_physics.diagnosis.replay.replay.EFFORT", 50)
    robot = AXIS.model_copy(
        update={"controller": AXIS.controller.model_copy(update={"sample_time": held}), "effects": ()}
    )
    replay = Replay.of(robot, [simulate(robot, seed=3)])
    assert replay is not None
    assert replay.energies(robot.with_effects(FRICTION), 0) is not None
    assert replay.energies(robot.with_effects(FRICTION), 0) is not None
    assert replay.count == 1
    assert (replay.made > 1) == replay.costly == long


def test_what_links_may_owe_to_bending_otherwise_is_not_held_against_a_name() -> None:
    """A beam a little stiffer than described is recorded, with nothing else missing."""
    robot = swaying(DEAR["bending"], 0.6)
    [link] = robot.flexible_links
    assert link.beam is not None
    beam = link.beam.model_copy(update={"young": 1.005 * link.beam.young})
    links = tuple(link.model_copy(update={"beam": beam}) if x.name == link.name else x for x in robot.links)
    replay = Replay.of(robot, [simulate(robot.model_copy(update={"links": links}), seed=20)])
    assert replay is not None
    energies = replay.energies(robot, 0)
    assert energies is not None
    assert energies.max() > 3  # it shows
    assert left_in_runs(replay, [energies], [energies]) == pytest.approx(1.0)
    assert left_in_runs(replay, [energies], [energies], lenient=True) is None
    wrong = replay.energies(robot.with_effects(FRICTION), 0)
    assert wrong is not None
    worse = left_in_runs(replay, [wrong], lenient=True)
    assert worse is not None
    assert worse > 2


def test_a_controller_does_not_know_of_a_beam_that_is_heavier_than_described() -> None:
    """Under computed torque with low gains a beam of a little more mass moves less than it was asked to."""
    robot = swaying(DEAR["bending"], 0.6)
    controller = robot.controller.model_copy(update={"kp": 1.0, "kd": 2.0})
    robot = robot.model_copy(update={"controller": controller})
    *_, heavier = _otherwise(robot)
    [added] = heavier.effects[len(robot.effects) :]
    numbers = {name: value / 2 for name, value in added.parameters.items()}
    half = EffectUse.model_validate({"effect": added.effect, "at": added.at, **numbers})
    replay = Replay.of(robot, [simulate(robot.with_effects(half), seed=20)])
    assert replay is not None
    energies = replay.energies(robot, 0)
    assert energies is not None
    assert energies.max() > 3  # it shows
    assert left_in_runs(replay, [energies], [energies], lenient=True) is None


def test_a_heavier_beam_is_so_much_mass_along_it() -> None:
    """Against the sum over many small pieces."""
    [link] = DEAR["bending"].flexible_links
    assert link.beam is not None
    beam = link.beam.model_copy(update={"direction": (0.6, 0.8, 0.0), "section_y": (-0.8, 0.6, 0.0)})
    found = _heavier(link.name, beam).parameters
    places = (np.arange(2000) + 0.5)[:, None] / 2000 * beam.length * np.array([0.6, 0.8, 0.0])
    piece = KNOWN * beam.density * beam.section.figures[0] * beam.length / 2000
    assert found["mass"] == pytest.approx(2000 * piece)
    for axis, value in zip("xyz", piece * places.sum(axis=0)):
        assert found[f"first_moment_{axis}"] == pytest.approx(value, abs=1e-12)
    about = piece * sum(float(r @ r) * np.eye(3) - np.outer(r, r) for r in places)
    for name, (i, k) in {"xx": (0, 0), "yy": (1, 1), "zz": (2, 2), "xy": (0, 1), "xz": (0, 2)}.items():
        # the middle rule errs by 1 / (4 n^2)
        assert found[f"inertia_{name}"] == pytest.approx(about[i, k], rel=1e-6, abs=1e-9)


def test_samples_may_be_missing() -> None:
    recording = simulate(AXIS, seed=11)
    keep = np.ones(len(recording), dtype=bool)
    keep[100:140] = keep[1000::7] = False
    shown = replace(
        recording, time=recording.time[keep], channels={k: v[keep] for k, v in recording.channels.items()}
    )
    replay = Replay.of(AXIS, [shown])
    assert replay is not None
    energies = replay.energies(AXIS, 0)
    assert energies is not None
    assert energies.max() < 1.2


def test_what_cannot_be_run_is_not() -> None:
    recording = simulate(AXIS, seed=12)
    blind = {k: v for k, v in recording.channels.items() if k != "joint1.reference_position"}
    gap = recording["joint1.torque"].copy()
    gap[50] = np.nan
    uneven = recording.time.copy()
    uneven[40] += 3e-4
    none = AXIS.model_copy(update={"controller": NoController()})
    assert Replay.of(none, [recording]) is None
    assert Replay.of(AXIS, []) is None
    assert Replay.of(AXIS, [replace(recording, channels=blind)]) is None
    assert Replay.of(AXIS, [recording.with_channels({"joint1.torque": gap})]) is None
    assert Replay.of(AXIS, [replace(recording, time=uneven)]) is None
    assert Replay.of(AXIS.model_copy(update={"sensors": ()}), [recording]) is None


def test_a_robot_that_runs_away_has_no_energies() -> None:
    replay = Replay.of(AXIS, [simulate(AXIS, seed=12)])
    assert replay is not None
    assert replay.energies(AXIS.with_effects(EffectUse(effect="payload", at="nobody", mass=1.0)), 0) is None


def test_joints_that_warm_are_not_run() -> None:
    """In a run every joint stays at one temperature, so that it says nothing of such a law."""
    replay = Replay.of(AXIS, [simulate(AXIS, seed=12)])
    assert replay is not None
    warm = EffectUse(effect="temperature_dependent_friction", at="joint1", rate=0.02)
    assert replay.energies(AXIS.with_effects(warm), 0) is None
