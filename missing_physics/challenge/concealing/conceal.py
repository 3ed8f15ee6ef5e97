"""Generation of a case's files from its design: simulate in Exudyn, tune the robot file if required."""

from __future__ import annotations

import io
import math
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import pyarrow as pa
import pyarrow.csv as pa_csv
from numpy.typing import NDArray

from exudyn_model import ExtraForce, Flexible, measured, simulate
from missing_physics.challenge.cases.truth import Design
from missing_physics.challenge.concealing.recorded_torque import TorquePath, logged
from missing_physics.challenge.concealing.torque_sensors import (
    torque_sensors,
    with_noise_factor,
    with_noise_of_effect,
    without_noise,
)
from missing_physics.challenge.concealing.tuned_file import limits_of, tuned
from missing_physics.challenge.draws import warming
from missing_physics.challenge.draws.file_errors import with_file_errors
from missing_physics.challenge.draws.foreign import foreign_force
from robot_model import InputError, NoController, Recording, Robot, Sensor, robot_to_toml

__all__ = ["EXACT", "FILES", "Concealed", "concealed", "with_exact"]

Array = NDArray[np.float64]

#: Files of a case folder, the same in every family.
FILES = ("robot.toml", "recording.csv", "validation.csv")
#: Both recordings without sensors, sealed until the score so that they need not be simulated again.
EXACT = "exact.npz"
#: Largest excess over the position limits, as a fraction of their range.
RUNAWAY = 1.0
#: Largest speed as a multiple of the velocity limit.
RACING = 10.0
#: Description in the robot file, the same in every case.
DESCRIPTION = "A robot whose recordings are to be diagnosed"


@dataclass(frozen=True)
class Concealed:
    """A generated case; its contents are reproducible from the design.

    Attributes:
        design: the drawn case.
    """

    design: Design

    @classmethod
    def of(cls, design: Design, exact: Sequence[tuple[Array, Mapping[str, Array]]]) -> Concealed:
        """A case with known training and held-out recordings without sensors (time, channels)."""
        case = cls(design)
        case.__dict__["exact"] = tuple(Recording(time, channels, "Exudyn") for time, channels in exact)
        return case

    @cached_property
    def exact(self) -> tuple[Recording, Recording]:
        """Training and held-out recording without sensors."""
        return self._run(self._real), self._run(self._other)

    def _run(self, robot: Robot) -> Recording:
        bending: Flexible = "beam" if self.design.beams else "modal"
        believed = self._file if self.design.conditions.file_errors else None
        made = simulate(
            self.path.finer(robot),
            sensors=False,
            extra=self._extra,
            flexible=bending,
            controller_model=believed,
        )
        _check_limits(robot, made)
        made = self.path.logged(made, self.joints)
        return warming.warmed(self.design.warming, made) if self.design.warming else made

    @cached_property
    def path(self) -> TorquePath:
        """Signal path from the actuator torques to the log."""
        robot = self.design.nominal
        assert robot.reference is not None
        hold = getattr(robot.controller, "sample_time", 0.0)
        return TorquePath(self.design.conditions.torque, hold, robot.reference.sample_rate)

    @property
    def joints(self) -> list[str]:
        """Names of the moving joints."""
        return [joint.name for joint in self.design.nominal.moving_joints]

    @cached_property
    def _file(self) -> Robot:
        """The machine with the file's errors, before any tuning; the controller uses these parameters."""
        return with_file_errors(self.design.nominal, self.design.conditions.file_errors)

    @property
    def _extra(self) -> tuple[ExtraForce, ...]:
        design = self.design
        found = [foreign_force(design.nominal, design.foreign)] if design.foreign else []
        for use in design.hidden:
            if design.warming and use.effect == warming.EFFECT:
                found.append(warming.fading(design.warming, design.nominal, use.parameters["rate"]))
        return tuple(found)

    @property
    def _real(self) -> Robot:
        return self.design.real

    @property
    def _other(self) -> Robot:
        return self._real.model_copy(update={"reference": self.design.validation})

    @cached_property
    def sensed_by(self) -> Robot:
        """The nominal robot with the sensors of the recordings; their noise is that of a channel at rest.

        A command has no noise, unless noise of an effect's size was drawn: it is then transmitted by an
        analogue line.
        """
        robot, ratio, use = self.design.nominal, self.design.noise_ratio, self.design.noise_of
        if ratio is not None and use is not None:
            noisy = with_noise_of_effect(robot, use, ratio, self.exact[0])
            return with_noise_factor(noisy, self.path.noise_gain)
        return with_noise_factor(robot, 0.0 if self.path.record.digital else self.path.noise_gain)

    @cached_property
    def recordings(self) -> tuple[Recording, Recording]:
        """Training and held-out recording with sensors."""
        sensors = self.sensed_by.sensors
        robots = (r.model_copy(update={"sensors": sensors}) for r in (self._real, self._other))
        one, two = (
            self._measured(robot, exact, seed)
            for robot, exact, seed in zip(robots, self.exact, self.design.noise_seeds)
        )
        return one, two

    def _measured(self, robot: Robot, exact: Recording, seed: int) -> Recording:
        made, warm = self._sensed(robot, exact, seed), self.design.warming
        if not self.design.conditions.factors.controller_known:
            recorded = {n: x for n, x in made.channels.items() if not n.endswith(".reference_position")}
            made = replace(made, channels=recorded)
        return warming.with_thermometer(warm, exact, made, seed) if warm else made

    def _sensed(self, robot: Robot, exact: Recording, seed: int) -> Recording:
        """Apply the sensors to the logged torques and to every other channel."""
        exact = exact.with_channels({f"{joint}.torque": logged(exact, joint) for joint in self.joints})
        if self.path.record.kind != "filtered":
            return measured(robot, exact, seed=seed)
        made = measured(without_noise(robot), exact, seed=seed)
        noisy = {
            s.channel: self._with_filtered_noise(s, made[s.channel], seed) for s in torque_sensors(robot)
        }
        return made.with_channels(noisy)

    def noiseless(self, which: int) -> Recording:
        """Recording without noise and rounding: 0 is the training recording, 1 the held-out one."""
        sensors = [s.model_copy(update={"noise": 0.0, "resolution": 0.0}) for s in self.sensed_by.sensors]
        exact = self.exact[which]
        exact = exact.with_channels({f"{joint}.torque": logged(exact, joint) for joint in self.joints})
        return measured(self._real.model_copy(update={"sensors": tuple(sensors)}), exact)

    def _with_filtered_noise(self, sensor: Sensor, values: Array, seed: int) -> Array:
        """Add low-pass filtered noise, then round."""
        chance = np.random.default_rng([seed, zlib.crc32(sensor.channel.encode()), 43])
        values = values + sensor.noise * self.path.noise(len(values), chance)
        return np.round(values / sensor.resolution) * sensor.resolution if sensor.resolution > 0 else values

    @cached_property
    def given(self) -> Robot:
        """The robot file for the diagnosis."""
        robot = self._file.model_copy(update={"sensors": self.sensed_by.sensors})
        if self.design.family == "tuned_away":
            robot = tuned(robot, self.exact[0], self.recordings[0], limits_of(self._file, self.design))
        factors = self.design.conditions.factors
        withheld: dict[str, object] = {"description": DESCRIPTION}
        if not factors.controller_known:
            withheld |= {"controller": NoController(), "reference": None}
        if not factors.noise_stated:
            withheld |= {"sensors": ()}
        return robot.model_copy(update=withheld)

    def completed(self, robot: Robot) -> Robot:
        """`robot` with the sensors, controller and held-out reference that its file may lack."""
        nominal = self.design.nominal
        added = {"sensors": self.sensed_by.sensors, "controller": nominal.controller}
        return robot.model_copy(update={**added, "reference": self.design.validation})

    def files(self) -> dict[str, bytes]:
        """Contents of the case folder by name."""
        tables = (_csv(recording) for recording in self.recordings)
        robot = robot_to_toml(self.given).encode()
        return dict(zip(FILES, (robot, *tables)))


def _check_limits(robot: Robot, made: Recording) -> None:
    """Raise `InputError` if a joint moved far beyond its limits, as under an unstable sampled controller.

    A real machine would have been stopped, so that such a recording is unrealistic.
    """
    for joint in robot.moving_joints:
        times = float(np.abs(made[f"{joint.name}.velocity"]).max()) / (joint.velocity_limit or math.inf)
        if times > RACING:
            raise InputError(f"{joint.name} ran away with {times:.2g} times its largest speed.")
        if joint.position_limits is None:
            continue
        (low, high), position = joint.position_limits, made[f"{joint.name}.position"]
        beyond = max(low - position.min(), position.max() - high) / (high - low)
        if beyond > RUNAWAY:
            raise InputError(f"{joint.name} ran out of its limits by {beyond:.2g} times their range.")


def concealed(design: Design) -> Mapping[str, bytes]:
    """The files of a case, and `EXACT`. Raises `InputError` if its robot cannot be simulated."""
    case = Concealed(design)
    return {**case.files(), EXACT: _npz(case.exact)}


def with_exact(design: Design, content: bytes) -> Concealed:
    """The case with known content of `EXACT`."""
    with np.load(io.BytesIO(content), allow_pickle=False) as arrays:
        parts = [{k[1:]: arrays[k] for k in arrays.files if k[0] == number} for number in "01"]
    return Concealed.of(design, [(part.pop("time"), part) for part in parts])


def _npz(exact: tuple[Recording, Recording]) -> bytes:
    buffer = io.BytesIO()
    arrays = {
        f"{number}{name}": values
        for number, recording in enumerate(exact)
        for name, values in {"time": recording.time, **recording.channels}.items()
    }
    np.savez_compressed(buffer, allow_pickle=False, **arrays)
    return buffer.getvalue()


def _csv(recording: Recording) -> bytes:
    buffer = io.BytesIO()
    table = pa.table({"time": recording.time, **recording.channels})
    pa_csv.write_csv(table, buffer, pa_csv.WriteOptions(quoting_style="needed"))
    return buffer.getvalue()
