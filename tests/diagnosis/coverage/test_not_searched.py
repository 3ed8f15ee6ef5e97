"""What a diagnosis says of effects that it did not look for, and that it did not."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
import pytest
from diagnosis_cases import ARM, AXIS, bare, recorded
from floating_cases import flyer

from missing_physics.diagnosis import Options, not_searched
from missing_physics.diagnosis import by_regression as diagnose
from missing_physics.diagnosis.candidates.structural import LOOKED_FOR
from missing_physics.diagnosis.not_searched import BEGINNING
from missing_physics.diagnosis.passive import naming as passive_naming
from missing_physics.diagnosis.passive.results import diagnose_passive
from missing_physics.diagnosis.preparation.setup import inertial_basis, make_segments
from missing_physics.diagnosis.replay.replay import Replay
from reference_model.effects.base import BodyEffect, GearEffect, JointEffect, SensorEffect
from reference_model.effects.catalogue import catalogue
from reference_model.simulation import simulate
from robot_model import Cycloid, EffectUse, Recording, Reference, Robot, load_robot

QUICK = Options(experiments=False, simulation=False)
DAMPING = EffectUse.model_validate({"effect": "modal_damping", "at": "link2", "damping_ratio": 0.03})
PASSIVE = "centrifugal_stiffening and modal_damping at link2, reaction_wheel and slosh at base"


@lru_cache(maxsize=1)
def bending() -> Robot:
    """The planar robot with links that bend, on a free base."""
    return load_robot("flexible_space_robot_planar").model_copy(
        update={"effects": (), "reference": Reference(duration=4.0, sample_rate=200.0, joints=moves())}
    )


def moves() -> tuple[Cycloid, ...]:
    return tuple(
        Cycloid(joint=f"joint{k}", displacement=way, start=0.3, duration=1.5)
        for k, way in ((1, 0.2), (2, -0.15))
    )


@lru_cache(maxsize=1)
def damped() -> tuple[Recording, Recording]:
    """Two recordings of the same with a link that is damped otherwise."""
    one, other = (simulate(bending().with_effects(DAMPING), seed=seed) for seed in (12300, 12301))
    return one, other


def told(
    robot: Robot, recordings: Sequence[Recording], replay: Replay | None = None, gears: Sequence[str] = ()
) -> tuple[str, ...]:
    """The sentences where the first recording is fitted."""
    segments = make_segments(robot, recordings)
    return not_searched.not_searched(robot, recordings, segments, 1, replay, gears)


def with_every_channel(recording: Recording, joints: int) -> Recording:
    """With second encoders and thermometers."""
    channels = dict(recording.channels)
    for k in range(1, joints + 1):
        channels[f"joint{k}.motor_position"] = recording[f"joint{k}.position"]
        channels[f"joint{k}.temperature"] = np.full(len(recording), 293.0)
    return Recording(recording.time, channels)


def test_every_effect_of_the_catalogue_is_looked_for_somewhere() -> None:
    everywhere = (JointEffect, BodyEffect, SensorEffect, GearEffect)
    special = {e.id for e in catalogue().values() if not isinstance(e, everywhere)}
    assert special == {*LOOKED_FOR, *not_searched.SEARCHED}


def test_nothing_is_said_where_everything_was_looked_for() -> None:
    recording = recorded(bare("two_link_arm"), ARM)
    assert told(bare("two_link_arm"), [with_every_channel(recording, 2)]) == ()
    (sentence,) = told(bare("two_link_arm"), [recording], gears=("joint2",))
    assert sentence == (
        "Not looked for, for want of channels: backlash, gear_hysteresis and joint_elasticity at joint1 "
        "(that needs JOINT.motor_position beside JOINT.position); temperature_dependent_friction at joint1 "
        "and joint2 (that needs JOINT.temperature)."
    )


@pytest.mark.proof
def test_base_and_links_ask_for_a_held_out_recording() -> None:
    one, other = damped()
    _, other_data, never = told(bending(), [one])
    held_out = "that needs a held-out recording (--validate)"
    assert other_data == f"Not looked for in these recordings: {PASSIVE} ({held_out})."
    segments = make_segments(bending(), [one])
    basis = inertial_basis(bending(), segments)
    assert not diagnose_passive(bending(), segments, (), basis, lambda phrase: None).ladder
    assert told(bending(), [one, other])[1:] == (never,)


def test_what_rigid_links_and_fixed_bases_alone_allow_is_reported_in_one_sentence() -> None:
    _, _, never = told(bending(), damped()[:1])
    assert never.startswith("Not looked for, whatever is recorded: link_flexibility at link1 (only where no")
    assert "contact at link1 and link2 (only on a base that is described as fixed)" in never
    assert "sensor_offset at link2.strain, link2.tip_acceleration, base.angular_velocity and" in never
    assert "encoder_eccentricity" not in never
    assert "base_motion" not in never  # it is free already
    assert "joint1" not in never


@pytest.mark.proof
def test_what_base_and_links_lack_counts_by_what_is_in_the_way(monkeypatch: pytest.MonkeyPatch) -> None:
    one, other = damped()
    slow = [Recording(r.time[::4], {k: v[::4] for k, v in r.channels.items()}) for r in damped()]
    assert f"{PASSIVE} (that needs at least 139 samples per second)" in told(bending(), slow)[1]
    blind = [
        Recording(r.time, {k: v for k, v in r.channels.items() if k.startswith("joint")}) for r in damped()
    ]
    gauges = "(that needs strain gauges, tip sensors or sensors of the base)"
    assert f"{PASSIVE} {gauges}" in told(bending(), blind)[1]
    for module in (passive_naming, not_searched):
        monkeypatch.setattr(module, "MOST_SAMPLES", 1000)
    shorter = "(that needs at most 1000 samples in all)."
    assert told(bending(), [one, other])[1] == f"Not looked for in these recordings: {PASSIVE} {shorter}"
    replay = Replay.of(bending(), [one], [other])
    assert replay is not None  # runs look for all but slosh, however long
    assert told(bending(), [one, other], replay)[1].endswith(f": slosh at base {shorter}")


@pytest.mark.proof
def test_nothing_is_wanting_of_long_recordings_that_ask_for_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    right = [simulate(bending(), seed=seed) for seed in (12302, 12303)]
    monkeypatch.setattr(passive_naming, "MOST_SAMPLES", 1000)
    assert not any(" in these recordings" in sentence for sentence in told(bending(), right))


def test_a_rigid_free_flyer_has_no_search_for_slosh_and_walls_and_runs_for_wheels() -> None:
    robot = flyer(6.0)
    one, other = (with_every_channel(simulate(robot, seed=seed), 2) for seed in (1, 2))
    unheld, never = told(robot, [one])
    assert unheld == (
        "Not looked for in these recordings: reaction_wheel at base (that needs a held-out recording "
        "(--validate) and runs in closed loop)."
    )
    assert never == (
        "Not looked for, whatever is recorded: contact at link1 and link2 (only on a base that is described "
        "as fixed); slosh at base (only where a link is described as flexible)."
    )
    replay = Replay.of(robot, [one], [other])
    assert replay is not None
    assert told(robot, [one, other], replay) == (never,)


def test_runs_look_where_encoders_and_torques_alone_were_recorded() -> None:
    robot = bending()
    joints = tuple(s for s in robot.sensors if s.channel.startswith("joint"))
    robot = robot.model_copy(update={"sensors": joints})
    whole = [simulate(robot, seed=seed) for seed in (12304, 12305)]
    both = [
        Recording(one.time, {k: v for k, v in one.channels.items() if k.startswith("joint")}) for one in whole
    ]
    replay = Replay.of(robot, both[:1], both[1:])
    assert replay is not None
    assert not any("slosh" in sentence or "damping" in sentence for sentence in told(robot, both, replay))
    [unseen] = [sentence for sentence in told(robot, both) if "slosh" in sentence]
    assert "that needs strain gauges, tip sensors or sensors of the base" in unseen


def test_walls_are_not_looked_for_inside_a_chain() -> None:
    robot = load_robot("six_joint_space_arm").model_copy(update={"effects": ()})
    fixed = robot.model_copy(update={"base": robot.base.model_copy(update={"kind": "fixed"})})
    recording = with_every_channel(recorded(fixed, (*ARM, *ARM, *ARM), duration=3.0), 6)
    (never,) = told(fixed, [recording])
    inside = [link.name for link in fixed.links if link.name in {j.parent for j in fixed.moving_joints}][1:]
    assert len(inside) == 4
    listed = f"{', '.join(inside[:-1])} and {inside[-1]}"
    assert never == f"Not looked for, whatever is recorded: contact at {listed} (only at the ends of chains)."


def test_the_torques_of_two_joints_must_tell_of_the_base() -> None:
    (never,) = told(bare("single_axis"), [with_every_channel(recorded(bare("single_axis"), AXIS), 1)])
    assert never == "Not looked for, whatever is recorded: base_motion at base (only where two joints move)."
    recording = with_every_channel(recorded(bare("two_link_arm"), ARM), 2)
    channels = {k: v for k, v in recording.channels.items() if k != "joint2.torque"}
    (wanting,) = told(bare("two_link_arm"), [Recording(recording.time, channels)])
    assert wanting == (
        "Not looked for, for want of channels: base_motion at base (that needs the torques of 2 joints)."
    )


def test_an_effect_without_any_search_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(not_searched, "LOOKED_FOR", {})
    (never,) = told(bare("two_link_arm"), [with_every_channel(recorded(bare("two_link_arm"), ARM), 2)])
    assert "contact and link_flexibility at every link" in never
    assert "(no search is there)" in never


@pytest.mark.proof
def test_a_diagnosis_says_it_last() -> None:
    friction = EffectUse.model_validate({"effect": "coulomb_friction", "at": "joint1", "torque": 3.0})
    robot = load_robot("two_link_arm")
    reference = robot.reference
    assert reference is not None
    short = reference.model_copy(update={"duration": 8.0, "sample_rate": 250.0})
    robot = robot.model_copy(update={"effects": (), "reference": short})
    run = simulate(robot.with_effects(friction), seed=1)
    half = Recording(
        run.time, {k: v for k, v in run.channels.items() if k != "joint2.torque"}, noise=run.noise
    )
    found = diagnose(robot, [half], options=QUICK).diagnosis
    assert found.could_not_tell[0].startswith("joint2: no torque, current or voltage is recorded")
    assert [s.startswith(BEGINNING) for s in found.could_not_tell].count(True) == 1
    assert found.could_not_tell[-1].startswith(BEGINNING)
    flyer_ = flyer(8.0)
    same = diagnose(flyer_, [simulate(flyer_, seed=1)], options=QUICK).diagnosis
    assert same.verdict == "consistent"
    assert any("no effect was looked for" in note for note in same.notes)
    # what the robot does to within the noise needs no search; other channels might show more
    assert [s for s in same.could_not_tell if s.startswith(BEGINNING)] == list(same.could_not_tell[-1:])
    assert "for want of channels" in same.could_not_tell[-1]
