"""Which effects were not looked for in some recordings of a robot, and what would let them be.

What is missing and was not looked for is named nowhere, and whatever is most like it may be named instead.
Every search tells here itself where it does not look. Only effects count that the robot could have.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from missing_physics.diagnosis.candidates.effects import AT_TORQUE, lacking
from missing_physics.diagnosis.candidates.mounts import FEWEST_TORQUES, no_mount
from missing_physics.diagnosis.candidates.structural import LOOKED_FOR, no_modes, searched
from missing_physics.diagnosis.candidates.walls import chain_ends, no_walls
from missing_physics.diagnosis.gear_runs.applied import without_two_encoders
from missing_physics.diagnosis.least_squares.problem import Segment
from missing_physics.diagnosis.passive.naming import MOST_SAMPLES, asked_for, too_long
from missing_physics.diagnosis.passive.results import HELD_OUT, needed
from missing_physics.diagnosis.passive.search import SEARCHED, places, plain_starts
from missing_physics.diagnosis.replay.replay import Replay
from reference_model.effects.base import GearEffect, JointEffect
from reference_model.effects.catalogue import catalogue, get_effect
from reference_model.effects.structure import StructureEffect
from robot_model import InputError, Recording, Robot

__all__ = ["BEGINNING", "not_searched", "not_searched_for_want_of_channels"]

#: What lets base and links that bend be searched.
RUNS = "runs in closed loop"
#: Every sentence begins with that.
BEGINNING = "Not looked for"


@dataclass(frozen=True)
class _Skipped:
    """One effect at one place, and why it was not looked for there."""

    effect: str
    place: str
    why: str


def not_searched(
    robot: Robot,
    recordings: Sequence[Recording],
    segments: Sequence[Segment],
    fitted: int,
    replay: Replay | None,
    gears: Collection[str] = (),
) -> tuple[str, ...]:
    """Sentences on what was not looked for; one for each kind of remedy, none where all was.

    Args:
        robot: as described.
        recordings: all of them, those that are fitted first.
        segments: of the recordings.
        fitted: number of recordings that are fitted.
        replay: runs along the recordings; None where they were not possible.
        gears: joints with known gears.
    """
    own, held_out = segments[:fitted], segments[fitted:]
    return (
        *not_searched_for_want_of_channels(robot, recordings, own, gears),
        *_told(" in these recordings", _unheld(robot, own, held_out, replay)),
        *_told(", whatever is recorded", [*_unsearchable(robot), *_sensors(segments)]),
    )


def not_searched_for_want_of_channels(
    robot: Robot, recordings: Sequence[Recording], segments: Sequence[Segment], gears: Collection[str] = ()
) -> tuple[str, ...]:
    """A sentence on what other channels would show; `segments` of the recordings that are fitted."""
    return tuple(_told(", for want of channels", _unrecorded(robot, recordings, segments, gears)))


def _unrecorded(
    robot: Robot, recordings: Sequence[Recording], segments: Sequence[Segment], gears: Collection[str]
) -> Iterator[_Skipped]:
    effects = catalogue().values()
    blind = [joint for joint in without_two_encoders(robot, recordings) if joint not in gears]
    for effect in effects:
        if isinstance(effect, GearEffect):
            both = "that needs JOINT.motor_position beside JOINT.position"
            yield from (_Skipped(effect.id, joint, both) for joint in blind)
    usable = np.all([segment.usable for segment in segments], axis=0)
    joints = [joint.name for joint, known in zip(robot.moving_joints, usable) if known]
    for effect in effects:
        if isinstance(effect, JointEffect):
            for joint in joints:
                channels = [name.replace(joint, "JOINT", 1) for name in lacking(segments, effect, joint)]
                if channels:
                    yield _Skipped(effect.id, joint, f"that needs {_listed(channels)}")
    if not no_mount(robot) and len(joints) < FEWEST_TORQUES:
        yield _Skipped("base_motion", "base", f"that needs the torques of {FEWEST_TORQUES} joints")


def _unheld(
    robot: Robot, fitted: Sequence[Segment], held_out: Sequence[Segment], replay: Replay | None
) -> Iterator[_Skipped]:
    """What base and links that bend may lack, where other recordings would show it."""
    every = (*fitted, *held_out)
    run = {term.key for term in plain_starts(robot)}
    if not robot.flexible_links:
        lacking = [*([] if held_out else [HELD_OUT]), *([] if replay is not None else [RUNS])]
        yield from (_Skipped(*key, f"that needs {_listed(lacking)}") for key in run if lacking)
        return
    wanting = needed(fitted, held_out)
    if wanting and replay is not None:  # all is run
        run.update(places(robot))
    long = too_long(every) and (bool(wanting) or asked_for(every))
    for key in places(robot):
        needs = [*wanting, *([f"at most {MOST_SAMPLES} samples in all"] if long else [])]
        if replay is not None and key in run:
            needs = [] if held_out else [HELD_OUT]
        if needs:
            yield _Skipped(*key, f"that needs {_listed(needs)}")


def _unsearchable(robot: Robot) -> Iterator[_Skipped]:
    """What no recording of this robot lets be looked for."""
    if why := no_modes(robot):
        rigid = [link.name for link in robot.links if not link.flexible and link.name not in robot.known]
        yield from (_Skipped("link_flexibility", link, why) for link in rigid if _may_bend(robot, link))
    yield from _walls(robot)
    if robot.base.kind == "fixed" and (why := no_mount(robot)):
        yield _Skipped("base_motion", "base", why)
    if not robot.flexible_links:
        run = {term.key for term in plain_starts(robot)}
        yield from (
            _Skipped(*key, "only where a link is described as flexible")
            for key in places(robot)
            if key not in run
        )
    for effect in catalogue().values():
        if searched(effect) and effect.id not in {*LOOKED_FOR, *SEARCHED}:
            yield _Skipped(effect.id, f"every {effect.place}", "no search is there")


def _walls(robot: Robot) -> Iterator[_Skipped]:
    """Where two joints move a link and no wall is looked for: what one alone feels is an end stop."""
    why, ends = no_walls(robot), chain_ends(robot)
    for link in robot.links:
        inboard = [joint for joint in robot.moving_joints if link.name in _outboard(robot, joint.child)]
        if len(inboard) < 2 and robot.base.kind == "fixed":
            continue
        if link.name in ends:
            if why:
                yield _Skipped("contact", link.name, why)
        elif any(joint.parent == link.name for joint in robot.moving_joints):
            yield _Skipped("contact", link.name, why or "only at the ends of chains")


def _outboard(robot: Robot, link: str) -> set[str]:
    """A link and all that it carries."""
    found, new = {link}, {link}
    while new := {joint.child for joint in robot.joints if joint.parent in new} - found:
        found |= new
    return found


def _may_bend(robot: Robot, link: str) -> bool:
    effect = get_effect("link_flexibility")
    assert isinstance(effect, StructureEffect)
    try:
        effect.changed(robot, link, {**{p.name: p.typical for p in effect.parameters}, **effect.defaults()})
    except InputError:
        return False
    return True


def _sensors(segments: Sequence[Segment]) -> Iterator[_Skipped]:
    """Channels that are relied upon and taken for right but for noise and a constant."""
    kinds: dict[str, None] = {}
    for segment in segments:
        if segment.motion.derived:
            base = ("base.angular_velocity", "base.attitude")
            there = {channel.rpartition(".")[0] for channel in segment.motion.others}
            kinds |= dict.fromkeys(kind for kind in base if kind in there)
        if segment.vibration is not None and segment.vibration.sight is not None:
            sight = segment.vibration.sight
            kinds |= dict.fromkeys(kind for kind in sight.kinds if not kind.endswith(".position"))
    where = "only at encoders, torque sensors and the gyro of a free base with rigid links"
    yield from (_Skipped(effect, kind, where) for effect in sorted(AT_TORQUE) for kind in kinds)


def _told(situation: str, skipped: Iterable[_Skipped]) -> Iterator[str]:
    """One sentence; effects with the same places and the same reason together."""
    found: dict[str, dict[str, dict[str, None]]] = {}
    for one in skipped:
        found.setdefault(one.why, {}).setdefault(one.effect, {})[one.place] = None
    parts = []
    for why, effects in found.items():
        alike: dict[tuple[str, ...], list[str]] = {}
        for effect, where in effects.items():
            alike.setdefault(tuple(where), []).append(effect)
        told = [f"{_listed(names)} at {_listed(where)}" for where, names in alike.items()]
        parts.append(f"{', '.join(told)} ({why})")
    if parts:
        yield f"{BEGINNING}{situation}: {'; '.join(parts)}."


def _listed(names: Sequence[str]) -> str:
    return f"{', '.join(names[:-1])} and {names[-1]}" if len(names) > 1 else "".join(names)
