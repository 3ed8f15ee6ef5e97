"""Robots run by themselves along what was asked of the real one, in closed loop, against what was recorded.

A regression along the recorded motion asks what force goes with a motion; it can be satisfied by a law that
would have brought about another motion. A run with nothing taken from the recording but the controller's
reference cannot: controller, robot and every effect must together give each recorded channel.

The error of a channel is in units of its sensor's noise, rounding included, so that its mean square is one
where nothing is missing.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.replay.references import tables
from missing_physics.diagnosis.replay.sensor_errors import (
    as_measured,
    dear,
    difference,
    known_noise,
    measured,
    spread,
)
from missing_physics.recordings import sensor_of, sensors_of
from reference_model.codegen.batched import Batched
from reference_model.control.motion import reference_function
from reference_model.effects.base import SensorEffect
from reference_model.effects.catalogue import get_effect
from reference_model.plant.truth import truth_of
from reference_model.steppers.effort import Effort
from robot_model import (
    Beam,
    EffectUse,
    InputError,
    Joint,
    JointReference,
    NoController,
    Recording,
    Reference,
    Robot,
    robot_to_toml,
)

__all__ = ["Asked", "Replay", "runs_tell"]

Array = NDArray[np.float64]

#: Fewest samples of a recording that is replayed.
FEWEST_SAMPLES = 128
#: Instants may differ from a regular grid by this part of a sample time.
SAME = 1e-3
#: A recorded reference is the robot file's own where it differs from it by less than this part of its range.
OWN = 1e-7
#: Longer recordings are not run: joints squared, times seconds; and samples.
MOST_WORK, MOST_SAMPLES = 600.0, 200_000
#: Of robots with many joints or bending links: coordinates squared, times steps, of all recordings together.
#: A run of so much takes some ten seconds.
MOST_STEPS = 4e6
#: A run that takes so many states of implicit steps more counts as one more run: half a second. An arm that
#: rattles between its limit of torque and a stiff controller takes ten. Of robots with many joints or bending
#: links runs take some seconds anyway.
EFFORT, EFFORT_DEAR = 20_000, 50_000
#: Where runs count as so many on average they take long.
LONG = 4
#: No beam's stiffness and mass are known better than to this part.
KNOWN = 0.01


@dataclass(frozen=True)
class Asked:
    """One recording and what was asked of the robot in it.

    Attributes:
        recording: without its last sample.
        rows: which samples of the run were recorded.
        robot: of the file, with the reference of this recording.
    """

    recording: Recording
    rows: NDArray[np.int_]
    robot: Robot


@dataclass
class Replay:
    """Runs along the references of some recordings.

    Attributes:
        robot: as described.
        asked: what is run.
        channels: that are compared.
        fitted: of so many recordings, the first ones, numbers are estimated; the others only judge.
        made: runs so far, of one recording each; those that take long count as several.
        count: of them, each counted once.
        centred: channels of which errors count about their mean, as their sensors' zeros are not known.
    """

    robot: Robot
    asked: tuple[Asked, ...]
    channels: tuple[str, ...]
    fitted: int
    made: int = 0
    count: int = 0
    centred: frozenset[str] = frozenset()
    _runs: dict[tuple[str, int], dict[str, Array] | None] = field(default_factory=dict, repr=False)
    _doubt: dict[int, Array] = field(default_factory=dict, repr=False)

    @classmethod
    def of(
        cls, robot: Robot, recordings: Sequence[Recording], validation: Sequence[Recording] = ()
    ) -> Replay | None:
        """What can be run of `recordings` and of those that are held out.

        Returns:
            None where that is not possible: no controller in the file, no recorded reference, position or
            torque, no channel with known noise, instants on no grid; or where it would take long.
        """
        fitted, recordings = len(recordings), (*recordings, *validation)
        if isinstance(robot.controller, NoController) or not recordings or not robot.moving_joints:
            return None
        if _long(robot, robot.controller.sample_time, recordings):
            return None
        asked = []
        for recording in recordings:
            one = _asked(robot, recording)
            if one is None:
                return None
            asked.append(one)
        known = [set(_compared(robot, recording)) for recording in recordings]
        channels = tuple(sorted(set.intersection(*known)))
        return cls(robot, tuple(asked), channels, fitted) if channels else None

    def about_means(self, channels: Collection[str]) -> Replay:
        """The same runs, errors of these channels counted about their means."""
        return replace(self, centred=frozenset(channels), made=0, count=0, _runs={}, _doubt={})

    def sizes(self, channel: str) -> tuple[float, ...]:
        """Unit of a channel's errors along each recording: the spread of its sensor there."""
        sensors = (sensor_of(self.robot, asked.recording, channel) for asked in self.asked)
        return tuple(spread(sensor) for sensor in sensors if sensor is not None)

    @property
    def costly(self) -> bool:
        """Whether runs take long: many operations at each instant, or many steps from one to the next."""
        return dear(self.robot) or self.made > LONG * self.count

    def energies(self, robot: Robot, which: int) -> Array | None:
        """Mean squares of the errors of `robot` along one of the recordings, shape (channels,).

        Args:
            robot: the robot file's, with other effects and numbers; its sensors and controller are kept.
            which: index of the recording.

        Returns:
            None where such a robot cannot be run.
        """
        errors = self.errors(robot, which)
        return None if errors is None else np.array([np.mean(errors[name] ** 2) for name in self.channels])

    def errors(self, robot: Robot, which: int, *, keep: bool = True) -> dict[str, Array] | None:
        """Recorded minus run, per channel and in units of its noise; see `energies`.

        Args:
            robot: see there.
            which: index of the recording.
            keep: whether the same will be asked again.
        """
        key = robot_to_toml(robot), which
        if key in self._runs:
            return self._runs[key]
        effort = Effort()
        found = self._run(robot, self.asked[which], effort)
        self.count += 1
        self.made += 1 + effort.states // (EFFORT_DEAR if dear(self.robot) else EFFORT)
        if keep:
            self._runs[key] = found
        return found

    def doubt(self, which: int) -> Array:
        """What a run's energies may owe to links that bend otherwise than described, shape (channels,).

        A beam of a few modes is not quite the real one. What a hundredth of its stiffness and of its mass
        make is about what geometrically exact beams differ from it, and is known of no real beam.

        Args:
            which: index of the recording.
        """
        if which not in self._doubt:
            total, before = np.zeros(len(self.channels)), self.errors(self.robot, which)
            for changed in _otherwise(self.robot):
                after = self.errors(changed, which)
                if before is not None and after is not None:
                    moved = (np.mean((after[name] - before[name]) ** 2) for name in self.channels)
                    total += np.array(list(moved))
            self._doubt[which] = total
        return self._doubt[which]

    def _run(self, robot: Robot, asked: Asked, effort: Effort) -> dict[str, Array] | None:
        return self.found(robot, asked, self.channels, effort)

    def found(
        self, robot: Robot, asked: Asked, channels: Sequence[str], effort: Effort
    ) -> dict[str, Array] | None:
        """Errors of these channels, run anew; None where such a robot cannot be run."""
        if not runs_tell(robot):
            return None
        joints = _beginning(robot, asked.recording)
        there = robot.model_copy(update={"reference": asked.robot.reference, "joints": joints})
        try:
            run = as_measured(there, effort)
        except InputError:
            return None
        errors = {}
        for name in channels:
            sensor = sensor_of(robot, asked.recording, name)
            assert sensor is not None
            error = difference(sensor, asked.recording[name], run[name][asked.rows])
            errors[name] = error - error.mean(axis=0) if name in self.centred else error
        return errors if all(bool(np.isfinite(e).all()) for e in errors.values()) else None


def runs_tell(robot: Robot) -> bool:
    """Whether runs hold all that a robot has: in them every joint stays at one temperature."""
    return not any("temperature" in get_effect(use.effect).needs for use in robot.effects)


def _otherwise(robot: Robot) -> Iterator[Robot]:
    """The robot with stiffer beams, and with heavier ones; nothing where there is no beam.

    Its controller knows what is described and no more: heavier by an effect, of which none is told.
    """
    beams = {link.name: link.beam for link in robot.links if link.beam is not None}
    if not beams:
        return
    links = []
    for link in robot.links:
        if link.beam is not None:
            stiffer = {name: getattr(link.beam, name) * (1 + KNOWN) for name in ("young", "shear")}
            link = link.model_copy(update={"beam": link.beam.model_copy(update=stiffer)})
        links.append(link)
    yield robot.model_copy(update={"links": tuple(links)})
    yield robot.with_effects(*(_heavier(name, beam) for name, beam in beams.items()))


def _heavier(link: str, beam: Beam) -> EffectUse:
    """What a beam of greater density adds to the mass properties of its link."""
    mass = KNOWN * beam.density * beam.section.figures[0] * beam.length
    along = beam.axes[:, 0]
    first = mass * beam.length / 2 * along
    about = mass * beam.length**2 / 3 * (np.eye(3) - np.outer(along, along))
    numbers = {"mass": mass, **{f"first_moment_{a}": value for a, value in zip("xyz", first)}}
    pairs = (("xx", 0, 0), ("yy", 1, 1), ("zz", 2, 2), ("xy", 0, 1), ("xz", 0, 2), ("yz", 1, 2))
    numbers |= {f"inertia_{name}": float(about[i, k]) for name, i, k in pairs}
    return EffectUse.model_validate({"effect": "inertia", "at": link, **numbers})


def _long(robot: Robot, hold: float, recordings: Sequence[Recording]) -> bool:
    """Whether runs would take long, told by what they consist of."""
    if max(len(recording) for recording in recordings) > MOST_SAMPLES:
        return True
    joints = len(robot.moving_joints)
    if not dear(robot):
        return joints**2 * max(recording.duration for recording in recordings) > MOST_WORK
    modes = sum(body.modes for body in truth_of(robot).tree.bodies)
    coordinates = joints + modes + (6 if robot.base.kind == "free" else 0)
    steps = sum(max(len(r), r.duration / hold if hold > 0 else 0) for r in recordings)
    return coordinates**2 * steps > MOST_STEPS


def _asked(robot: Robot, recording: Recording) -> Asked | None:
    """What was asked in a recording; None where that is not known."""
    for joint in robot.moving_joints:
        needed = [f"{joint.name}.position"]
        if joint.actuator is not None:
            needed += [f"{joint.name}.reference_position", f"{joint.name}.torque"]
        if any(name not in recording or not np.isfinite(recording[name]).all() for name in needed):
            return None
    step = _sample_interval(recording.time)
    if step <= 0:
        return None
    # Where a table ends the reference stands still at once: the last sample is not compared.
    shown = recording.window(float(recording.time[0]), float(recording.time[-1]) - step / 2)
    rows = np.round((shown.time - shown.time[0]) / step).astype(int)
    if len(shown) < FEWEST_SAMPLES or np.abs(shown.time - shown.time[0] - rows * step).max() > SAME * step:
        return None
    joints = _beginning(robot, shown)
    motions = _own(robot, recording) if joints == robot.joints else None
    reference = Reference(
        duration=float(rows[-1]) * step,
        sample_rate=1.0 / step,
        joints=tuple(tables(robot, recording)) if motions is None else motions,
    )
    there = robot.model_copy(update={"reference": reference, "joints": joints})
    return Asked(shown, rows, there)


def _sample_interval(time: Array) -> float:
    """Of a regular grid [s]; 0 where there is none.

    By its whole length: one interval's rounding error, counted as often as there are samples, would put late
    ones before the instant at which a sampled controller acts.
    """
    usual = float(np.median(np.diff(time))) if time.size > 1 else 0.0
    return float(time[-1] - time[0]) / max(round(float(time[-1] - time[0]) / usual), 1) if usual > 0 else 0.0


def _own(robot: Robot, recording: Recording) -> tuple[JointReference, ...] | None:
    """The robot file's reference where it is the recorded one; it takes fewer steps than a table of it."""
    time = recording.time - recording.time[0]
    if robot.reference is None or time[-1] > robot.reference.duration * (1 + SAME):
        return None
    own = Batched(reference_function(robot))(time[:, None])[0]
    for k, joint in enumerate(robot.moving_joints):
        name = f"{joint.name}.reference_position"
        if name in recording and np.abs(recording[name] - own[:, k]).max() > OWN * np.ptp(own[:, k]):
            return None
    return robot.reference.joints


def _beginning(robot: Robot, recording: Recording) -> tuple[Joint, ...]:
    """The robot's joints, where they begin in a recording."""
    return tuple(
        j.model_copy(update={"initial_position": _start(robot, j.name, recording)})
        if j.kind != "fixed"
        else j
        for j in robot.joints
    )


def _start(robot: Robot, joint: str, recording: Recording) -> float:
    """Where a joint begins: as described, unless its encoder says otherwise beyond its noise.

    An encoder with an error that the robot has says something else of the described place, too.
    """
    described = robot.joint(joint).initial_position
    name = f"{joint}.position"
    sensor = sensor_of(robot, recording, name)
    if name not in recording or sensor is None:
        return described
    first = float(recording[name][0])
    beyond = 6.0 * float(np.hypot(sensor.noise, sensor.resolution))
    if abs(first - described - _error_at_rest(robot, name, described)) <= beyond:
        return described
    return first - _error_at_rest(robot, name, first)


def _error_at_rest(robot: Robot, channel: str, value: float) -> float:
    """What a channel that stays at a value is told to be off by."""
    told = np.full(2, value)
    for use in robot.effects:
        effect = get_effect(use.effect)
        if use.at == channel and isinstance(effect, SensorEffect):
            told = effect.apply(np.arange(2.0), told, use.parameters)
    return float(told[0]) - value


def _compared(robot: Robot, recording: Recording) -> Iterator[str]:
    """Channels of which a run tells what is recorded, and whose noise is known."""
    sensors = {sensor.channel: sensor for sensor in sensors_of(robot, recording)}
    for name in measured(recording):
        if name in sensors and known_noise(sensors[name]) and bool(np.isfinite(recording[name]).all()):
            yield name
