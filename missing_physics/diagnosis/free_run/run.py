"""Free runs: a robot simulated in closed loop along the reference of a recording.

One-step or torque errors say how well a model explains each instant; a free run says what the model is worth
as a simulation. It starts where the recording starts and is told nothing afterwards but the reference, when
the drive was on, and what else the recording knows of the surroundings: temperature and supply voltage.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.free_run.model import Row
from missing_physics.diagnosis.free_run.numbers import REFERENCE_DELAY, adjustables
from missing_physics.diagnosis.free_run.step import ClosedLoop
from reference_model.codegen.batched import Batched
from reference_model.control.laws import sample_time
from reference_model.plant.acting import AMBIENT_TEMPERATURE
from robot_model import Controller, InputError, Recording, Robot, VoltageServo

__all__ = ["SUPPLY_CHANNEL", "FreeRun", "PositionError", "Runner", "simulate_recording"]

Array = NDArray[np.float64]

#: A recording's channel with the supply voltage [V], where it was measured.
SUPPLY_CHANNEL = "supply.voltage"
#: Longest step [s]: a position loop of 10 Hz is then simulated to a thousandth of its amplitude.
LONGEST_STEP = 2.5e-3
#: Span over which the first velocity is estimated [s], the fewest samples for it, and the degree of the
#: polynomial: cubic, as a joint that gravity takes along at the start changes its acceleration as well.
START_SPAN = 0.05
START_SAMPLES = 8
START_DEGREE = 3
#: A first velocity counts when it exceeds this many standard errors.
SURE_VELOCITY = 4.0
#: and when it carries the joint further than this over that span [rad or m], beyond rounding.
NO_TRAVEL = 1e-9
#: The last Newton correction may be this part of the largest speed.
UNSOLVED = 1e-3


@dataclass(frozen=True)
class PositionError:
    """Error of a free run's position, in rad or m."""

    mean_absolute: float
    rms: float


@dataclass(frozen=True)
class FreeRun:
    """A free run.

    Attributes:
        recording: `JOINT.position` as the sensors say it, `.velocity`, `.torque` and `.reference_position`,
            on the time base of the measured recording.
        errors: per joint that was recorded.
    """

    recording: Recording
    errors: Mapping[str, PositionError]


def simulate_recording(
    robot: Robot,
    recording: Recording,
    *,
    controller: Controller | None = None,
    reference_delay: float = 0.0,
    longest_step: float = LONGEST_STEP,
) -> FreeRun:
    """Run `robot` in closed loop along the recording's references.

    Args:
        robot: with a fixed base and a controller.
        recording: holds `JOINT.position` of every moving joint and `JOINT.reference_position`; a reference
            that is missing (NaN) means that the drive is off, a joint without the channel holds its first
            position. `JOINT.temperature` and `supply.voltage` are used where they exist.
        controller: in force during this recording, where it is not the robot's own.
        reference_delay: by how much the controller sees its reference late [s].
        longest_step: of the integration [s]; samples further apart are divided.

    Raises:
        InputError: no position, a free base, or steps that do not converge.
    """
    changed = robot if controller is None else robot.model_copy(update={"controller": controller})
    runner = Runner(changed, recording, longest_step=longest_step)
    return runner.free_run(ClosedLoop(changed), reference_delay=reference_delay)


class Runner:
    """One recording prepared for free runs.

    Args:
        robot: with the controller that was in force; names the joints and the supply.
        recording: see `simulate_recording`.
        longest_step: see there.

    Attributes:
        recorded: measured positions, shape (N, n).
        time: [s], shape (N,).
    """

    def __init__(self, robot: Robot, recording: Recording, *, longest_step: float = LONGEST_STEP) -> None:
        self.robot, self.recording = robot, recording
        self._joints = tuple(joint.name for joint in robot.moving_joints)
        if len(recording) < START_SAMPLES:
            raise InputError(f"{recording.source or 'the recording'} is too short for a free run.")
        self.time = recording.time
        self.recorded = np.column_stack([recording[f"{name}.position"] for name in self._joints])
        self._parts = np.maximum(1, np.ceil(np.diff(self.time) / longest_step - 1e-9)).astype(int)
        self._samples = np.concatenate([[0], np.cumsum(self._parts)])
        self._rows = self._make_rows()
        self._start = self._first_state()

    @property
    def steps(self) -> int:
        """Number of steps of a run."""
        return int(self._samples[-1])

    @property
    def rows(self) -> Array:
        """What the run is told at the recorded samples, `Row` by `Row`, shape (N, rows)."""
        return np.asarray(self._rows[self._samples])

    def constants(self, values: Mapping[str, float] | None = None) -> Array:
        """The robot's numbers, some of them replaced, in the order that free runs take them."""
        own = {name: number.value for name, number in adjustables(self.robot).items()}
        given = {name: value for name, value in (values or {}).items() if name in own}
        return np.array(list({**own, **given}.values()))

    def positions(self, loop: ClosedLoop, values: Mapping[str, float] | None = None) -> tuple[Array, Array]:
        """Measured positions in a free run, shape (N, n), and derivatives by `loop.free`, (N, n, F)."""
        constants = self.constants(values)
        n, count = len(self._joints), len(loop.free)
        first = loop.first(*self._start, self._rows[0], constants).full().ravel()
        chain = loop.sensitivities(first, self._rows, constants)[self._samples]
        rows = self._rows[self._samples]
        said = Batched(loop.output)(chain[:, : loop.size], rows, constants)[0][:, :n]
        slopes = Batched(loop.slope)(chain, rows, constants)[0]
        return said, slopes.reshape(len(rows), count, n).transpose(0, 2, 1)

    def free_run(
        self, loop: ClosedLoop, values: Mapping[str, float] | None = None, *, reference_delay: float = 0.0
    ) -> FreeRun:
        """A free run with the robot's numbers, some of them replaced by `values`."""
        constants = self.constants({REFERENCE_DELAY: reference_delay, **(values or {})})
        first = loop.first(*self._start, self._rows[0], constants).full().ravel()[: loop.size]
        states = loop.run(first, self._rows, constants)[self._samples]
        rows, n = self._rows[self._samples], len(self._joints)
        self._check(states, n)
        said = Batched(loop.output)(states, rows, constants)[0]
        channels, ends = {}, Row.ends(n)
        for k, name in enumerate(self._joints):
            channels[f"{name}.position"] = said[:, k]
            channels[f"{name}.velocity"] = states[:, n + k]
            channels[f"{name}.torque"] = said[:, n + k]
            channels[f"{name}.reference_position"] = rows[:, ends[1] + k]
        source = f"free run of robot '{self.robot.name}' along {self.recording.source or 'a recording'}"
        return FreeRun(Recording(self.time, channels, source), self.errors(said[:, :n]))

    def errors(self, positions: Array) -> dict[str, PositionError]:
        """Errors of simulated positions, shape (N, n), per joint; missing samples do not count."""
        found = {}
        for k, name in enumerate(self._joints):
            gap = (positions - self.recorded)[:, k]
            gap = gap[np.isfinite(gap)]
            found[name] = PositionError(float(np.abs(gap).mean()), float(np.sqrt(np.mean(gap**2))))
        return found

    def _check(self, states: Array, joints: int) -> None:
        speed = np.abs(states[:, joints : 2 * joints]).max()
        if not np.isfinite(states).all() or states[-1, -1] > UNSOLVED * max(speed, 1e-6):
            raise InputError(
                f"robot '{self.robot.name}': the free run along {self.recording.source or 'the recording'} "
                "does not converge; lower the controller's gains or the longest step."
            )

    def _make_rows(self) -> Array:
        """Rows on the grid of the steps, shape (M, rows)."""
        fine = np.interp(np.arange(self._samples[-1] + 1), self._samples, self.time)
        on = np.ones(self.time.size)
        references, rates, bends, temperatures = [], [], [], []
        for k, name in enumerate(self._joints):
            reference, known = self._reference(k, name)
            on *= known
            rate = np.gradient(reference, self.time)
            references.append(reference)
            rates.append(rate)
            bends.append(np.gradient(rate, self.time))
            temperatures.append(_filled(self.recording, f"{name}.temperature", AMBIENT_TEMPERATURE))
        columns = [*references, *rates, *bends, *temperatures]
        smooth = [np.interp(fine, self.time, column) for column in columns]
        supply = np.interp(fine, self.time, self._supply())
        switched = on[np.searchsorted(self._samples, np.arange(fine.size), side="right") - 1]
        return np.column_stack([fine, *smooth, switched, supply, self._ticks(fine)])

    def _reference(self, k: int, name: str) -> tuple[Array, Array]:
        """Reference of a joint without gaps, and 1 where it was given, else 0."""
        channel = f"{name}.reference_position"
        if channel not in self.recording:
            return np.full(self.time.size, self.recorded[0, k]), np.ones(self.time.size)
        given = np.isfinite(self.recording[channel])
        return _filled(self.recording, channel, self.recorded[0, k]), given.astype(float)

    def _supply(self) -> Array:
        servo = self.robot.controller
        if not isinstance(servo, VoltageServo) or SUPPLY_CHANNEL not in self.recording:
            return np.ones(self.time.size)
        return _filled(self.recording, SUPPLY_CHANNEL, servo.supply) / servo.supply

    def _ticks(self, fine: Array) -> Array:
        hold = sample_time(self.robot)
        if hold <= 0:
            return np.zeros(fine.size)
        number = np.floor((fine - fine[0]) / hold + 1e-9)
        return np.r_[1.0, (np.diff(number) > 0).astype(float)]

    def _first_state(self) -> tuple[Array, Array]:
        """Recorded position and velocity at the first sample; zero velocity unless surely another."""
        span = max(int(np.searchsorted(self.time, self.time[0] + START_SPAN)), START_SAMPLES)
        time = self.time[:span] - self.time[0]
        positions, velocities = [], []
        for name, column in zip(self._joints, self.recorded[:span].T):
            known = np.isfinite(column)
            if known.sum() < START_SAMPLES:
                raise InputError(
                    f"{self.recording.source or 'the recording'} has no position in its first samples."
                )
            fit, covariance = np.polyfit(time[known], column[known], START_DEGREE, cov=True)
            moved = abs(fit[-2]) * time[-1] > max(
                self.recording.resolution.get(f"{name}.position", 0.0), NO_TRAVEL
            )
            sure = moved and abs(fit[-2]) > SURE_VELOCITY * np.sqrt(covariance[-2, -2])
            velocities.append(float(fit[-2]) if sure else 0.0)
            positions.append(float(column[known][0]))
        return np.array(positions), np.array(velocities)


def _filled(recording: Recording, channel: str, otherwise: float) -> Array:
    """A channel without gaps: interpolated, or `otherwise` where there is none."""
    if channel not in recording:
        return np.full(len(recording), otherwise)
    values = recording[channel]
    known = np.isfinite(values)
    if not known.any():
        return np.full(len(recording), otherwise)
    return np.interp(recording.time, recording.time[known], values[known])
