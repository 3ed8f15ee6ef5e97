"""What the data can carry is said before anything is fitted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from diagnosis_cases import ARM, Sines, bare, recorded

from missing_physics.diagnosis.excitation import Excitation, judge_excitation
from missing_physics.diagnosis.setup import make_segments
from robot_model import Recording

ROBOT = bare("two_link_arm", noise=True)


def judged(*recordings: Recording, cutoff: float | None = None) -> Excitation:
    return judge_excitation(ROBOT, make_segments(ROBOT, recordings, cutoff=cutoff))


def test_a_rich_motion_is_enough_and_nothing_is_said() -> None:
    assert judged(recorded(ROBOT, ARM, seed=1)) == Excitation(True, ())


def test_too_short_says_how_much_more() -> None:
    found = judged(recorded(ROBOT, ARM, seed=1, duration=3.0), cutoff=2.5)
    assert not found.enough
    [sentence] = found.sentences
    # two times 40 rows at four per period of the cut-off
    assert sentence.endswith("cut-off of 2.5 Hz; record at least 8 s more.")
    assert sentence.startswith("only ")


def test_one_joint_without_torque_is_named_and_the_other_still_judged() -> None:
    made = recorded(ROBOT, ARM, seed=1)
    channels = {k: v for k, v in made.channels.items() if k != "joint2.torque"}
    found = judged(Recording(made.time, channels))
    assert found.enough
    assert [s.split(":")[0] for s in found.sentences] == ["joint2"]
    assert "torque is neither recorded nor computable" in found.sentences[0]


def test_no_torque_at_all_is_not_enough() -> None:
    made = recorded(ROBOT, ARM, seed=1)
    found = judged(Recording(made.time, {k: v for k, v in made.channels.items() if "position" in k}))
    assert not found.enough
    assert len(found.sentences) == 2


def test_a_joint_that_rests_is_named() -> None:
    resting = replace(ARM[1], amplitudes=(0.0, 0.0, 0.0))
    found = judged(recorded(ROBOT, (ARM[0], resting), seed=1))
    assert found.enough
    assert found.sentences == (
        "joint2 does not move beyond its noise, so nothing that depends on motion could be told there.",
    )


def test_one_direction_cannot_tell_friction_from_an_offset() -> None:
    made = recorded(ROBOT, ARM, seed=1)
    slow = Sines((0.02,), (0.3,), (0.0,))
    time = made.time
    ramp = made.with_channels({"joint2.position": 0.2 * time + slow(time)[0]})
    found = judged(ramp)
    assert found.enough
    assert len(found.sentences) == 1
    assert found.sentences[0].startswith("joint2 moves in one direction only")
    # a second recording in the other direction mends it
    back = ramp.with_channels({"joint2.position": -np.asarray(ramp["joint2.position"])})
    both = judged(ramp, back)
    assert both.enough
