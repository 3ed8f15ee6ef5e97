"""Recordings for comparing the diagnosis with other tools, with one motion and one error measure for all.

Every tool gets the same nominal robot and the same fitted recordings; no tool sees the held-out recordings.
The findings of a tool enter the torque that it predicts along the held-out motion, which is estimated once,
by the usual recipe and not by the diagnosis.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import signal
from scipy.interpolate import make_interp_spline

from benchmarks.evidence import EXAMPLES, recording_of
from exudyn_model import simulate
from missing_physics.challenge.torques.along import ArmAlong
from missing_physics.recordings.datasets import fetch_dataset
from reference_model.effects.base import JointEffect
from reference_model.effects.catalogue import get_effect
from robot_model import EffectUse, Joint, MultiSine, Recording, Robot, load_robot

__all__ = ["CASES", "Case", "Motion", "load_case", "motor_of"]

Array = NDArray[np.float64]

#: Zero-phase Butterworth filter of position and torque: order.
ORDER = 4
#: Samples kept per period of the cut-off, and periods of it omitted at both ends.
KEPT_PER_PERIOD, EDGE_PERIODS = 4.0, 2.0
#: Torque-dependent friction or a lag is iterated until the torque changes by less than this fraction of its
#: rms, or this many times: a lag of 0.1 s needs most.
SETTLED, ROUNDS = 1e-4, 300
#: Joints slower than this fraction of their largest speed are excluded from the errors: no model predicts
#: static friction at rest.
MOVING = 0.02
#: Seeds of the simulated cases: parameters and noise of the fitted recording, noise of the held-out one.
ARM_SEEDS, AXIS_SEEDS = (10300, 10310), (10301, 10311)
#: Factors on the reference motion's frequencies for the held-out motion of a simulated robot.
OTHER_TEMPO = 0.83
#: Logs of the servo, by their time of day: gains 100 and 400 are fitted, 200 is held out. The motion with the
#: motor switched off is excluded, since the torque cannot be computed from a voltage there.
SERVO_FITTED = ("10h28m10", "10h28m24", "10h28m32", "10h29m14", "10h29m29", "10h29m37")
SERVO_HELD_OUT = ("10h28m42", "10h28m57", "10h29m04")


@dataclass(frozen=True)
class Case:
    """A nominal robot, fitted and held-out recordings.

    Attributes:
        title, origin: in words.
        nominal: the robot file's robot.
        fitted, held_out: recordings.
        cutoff: of the common filter [Hz].
        rate: grid on which the motion is estimated [Hz].
        known: `effect@place.parameter` or an inertial number to its published or true value.
        truth: "published" or "true".
        hidden: missing physics beyond the terms that the other tools fit, in words.
    """

    title: str
    origin: str
    nominal: Robot
    fitted: tuple[Recording, ...]
    held_out: tuple[Recording, ...]
    cutoff: float
    rate: float
    known: Mapping[str, float]
    truth: str
    hidden: str = ""

    @cached_property
    def motions(self) -> tuple[Motion, ...]:
        """Of the fitted recordings."""
        return tuple(self._motion(r) for r in self.fitted)

    @cached_property
    def held_out_motions(self) -> tuple[Motion, ...]:
        """Of the held-out recordings."""
        return tuple(self._motion(r) for r in self.held_out)

    def _motion(self, recording: Recording) -> Motion:
        return Motion(self.nominal, recording, cutoff=self.cutoff, rate=self.rate)


@dataclass(frozen=True)
class Motion:
    """Joint motion and torque of one recording by the usual recipe: filter, differentiate, decimate.

    Attributes:
        robot: the nominal robot.
        recording: as it was given to every tool.
    """

    robot: Robot
    recording: Recording
    cutoff: float
    rate: float

    @cached_property
    def time(self) -> Array:
        """Even instants [s], shape (N,)."""
        time = self.recording.time
        return np.asarray(np.arange(time[0], time[-1] + 1e-9, 1.0 / self.rate))

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the n joints."""
        return tuple(joint.name for joint in self.robot.moving_joints)

    @cached_property
    def state(self) -> tuple[Array, Array, Array]:
        """Position, velocity and acceleration, shape (N, n) each."""
        position = self._smooth(self._columns("position"))
        spline = make_interp_spline(self.time, position, k=5)
        return position, spline(self.time, 1), spline(self.time, 2)

    @cached_property
    def torque(self) -> Array:
        """At the joints, as recorded or of the motor's voltage equation, shape (N, n)."""
        columns = []
        for k, joint in enumerate(self.robot.moving_joints):
            if f"{joint.name}.torque" in self.recording:
                columns.append(self._column(f"{joint.name}.torque"))
                continue
            columns.append(self._of_voltage(k, self._column(f"{joint.name}.voltage")))
        return np.column_stack(columns)

    @cached_property
    def drive(self) -> Array:
        """What was recorded of the actuators, torque or voltage, shape (N, n)."""
        names = [
            f"{name}.torque" if f"{name}.torque" in self.recording else f"{name}.voltage"
            for name in self.joints
        ]
        return np.column_stack([self._column(name) for name in names])

    def _of_voltage(self, k: int, volts: Array) -> Array:
        """Torque of the nominal motor of joint k, shape (N,)."""
        constant, resistance = motor_of(self.robot.moving_joints[k])
        return np.asarray(constant / resistance * (volts - constant * self.state[1][:, k]))

    @cached_property
    def exact(self) -> Recording:
        """The estimated motion and the torque as channels."""
        channels = {}
        for k, joint in enumerate(self.joints):
            for name, values in zip(("position", "velocity", "acceleration"), self.state):
                channels[f"{joint}.{name}"] = values[:, k]
            channels[f"{joint}.torque"] = self.torque[:, k]
            channels[f"{joint}.friction_torque"] = np.zeros(self.time.size)  # no tool fits a modifier
        return Recording(self.time, channels, self.recording.source)

    @cached_property
    def along(self) -> ArmAlong:
        """The nominal robot along this motion."""
        return ArmAlong(self.robot, self.exact)

    def predicted(self, robot: Robot) -> Array:
        """Torque required by `robot` with all its effects along this motion, shape (N, n).

        Where a voltage is recorded, it is the voltage required by `robot` with its own motor, converted to a
        torque by the nominal robot's motor, so that other motor constants cannot change the measurement.
        No measured actuator data enter.
        """
        along = ArmAlong(robot, self.exact)
        torque = along.rigid.copy()
        for _ in range(ROUNDS):
            before = torque
            vars(along)["torque"] = torque  # not the measured one, which is what is to be predicted
            torque = along.rigid + self._effects(along, robot)
            if np.std(torque - before) <= SETTLED * np.std(torque):
                break
        for k, joint in enumerate(robot.moving_joints):
            if f"{joint.name}.torque" not in self.recording:
                constant, resistance = motor_of(joint)
                volts = torque[:, k] * resistance / constant + constant * self.state[1][:, k]
                torque[:, k] = self._of_voltage(k, volts)
        return torque

    def _effects(self, along: ArmAlong, robot: Robot) -> Array:
        """Torque contributions of the robot's effects, shape (N, n)."""
        friction = np.zeros_like(self.torque)
        for use in robot.effects:
            effect = get_effect(use.effect)
            if isinstance(effect, JointEffect) and effect.is_friction_law and not effect.is_modifier:
                friction -= along.part(use, friction=np.zeros(self.time.size))
        added = np.zeros_like(self.torque)
        for use in robot.effects:
            place = use.at.split(".")[0]
            k = self.joints.index(place) if place in self.joints else 0
            added += along.part(use, friction=friction[:, k])
        return added

    @cached_property
    def moves(self) -> NDArray[np.bool_]:
        """Where each joint is compared, at the rows of `reduced`, shape (K, n)."""
        speed = np.abs(self.reduced(self.state[1]))
        return np.asarray(speed > MOVING * speed.max(axis=0))

    def reduced(self, values: Array) -> Array:
        """Filtered like the torque, without ends, decimated; along the first axis."""
        edge = int(EDGE_PERIODS * self.rate / self.cutoff)
        stride = max(1, int(self.rate / (KEPT_PER_PERIOD * self.cutoff)))
        return self._smooth(values)[edge:-edge:stride]

    def _smooth(self, values: Array) -> Array:
        sections = signal.butter(ORDER, self.cutoff, fs=self.rate, output="sos")
        return np.asarray(signal.sosfiltfilt(sections, values, axis=0))

    def _columns(self, quantity: str) -> Array:
        return np.column_stack([self._column(f"{joint}.{quantity}") for joint in self.joints])

    def _column(self, channel: str) -> Array:
        return np.asarray(np.interp(self.time, self.recording.time, self.recording[channel]))


def motor_of(joint: Joint) -> tuple[float, float]:
    """Torque constant at the joint [N m/A] and resistance [ohm]."""
    motor = joint.actuator
    assert motor is not None
    assert motor.torque_constant is not None
    assert motor.resistance is not None
    return motor.gear_ratio * motor.torque_constant, motor.resistance


def emps() -> Case:
    """A real axis with only the mass known."""
    folder = fetch_dataset("emps")
    files = ("DATA_EMPS.mat", "DATA_EMPS_PULSES.mat")
    fitted, held = (recording_of(folder, name, example="emps") for name in files)
    return Case(
        title="EMPS, real",
        origin="`DATA_EMPS.mat` is fitted, `DATA_EMPS_PULSES.mat` held out; nominal robot "
        "`examples/emps/mass_only.toml`",
        nominal=load_robot(EXAMPLES / "emps" / "mass_only.toml"),
        fitted=(fitted,),
        held_out=(held,),
        cutoff=50.0,
        rate=1000.0,
        known={  # Janot, Gautier, Brunot, "Data set and reference models of EMPS", 2019
            "carriage.mass": 95.1089,
            "viscous_friction@joint1.coefficient": 203.5034,
            "coulomb_friction@joint1.torque": 20.3935,
            "torque_offset@joint1.torque": 3.1648,
        },
        truth="published",
    )


def servo() -> Case:
    """A real hobby servo with a pendulum, from its position and voltage."""
    folder = fetch_dataset("servo_pendulum")

    def logs(times: tuple[str, ...]) -> tuple[Recording, ...]:
        names = (f"xl330_2026-01-15_{time}.json" for time in times)
        return tuple(recording_of(folder, name, example="servo_pendulum") for name in names)

    return Case(
        title="Servo pendulum, real",
        origin="six logs of gains 100 and 400 are fitted, three of gain 200 held out; nominal robot "
        "`examples/servo_pendulum/nominal.toml`, motor as published, no friction",
        nominal=load_robot(EXAMPLES / "servo_pendulum" / "nominal.toml"),
        fitted=logs(SERVO_FITTED),
        held_out=logs(SERVO_HELD_OUT),
        cutoff=10.0,
        rate=200.0,
        known={  # model M1 of the XL330, bam/params/xl330 of BAM's main branch
            "viscous_friction@joint1.coefficient": 0.0036616723,
            "coulomb_friction@joint1.torque": 0.0128327204,
        },
        truth="published",
    )


def arm() -> Case:
    """The shipped arm with Stribeck friction in one joint."""
    chance = np.random.default_rng(ARM_SEEDS[0])
    coulomb = float(chance.uniform(1.0, 2.0))
    sizes = {
        "coulomb_torque": coulomb,
        "static_torque": coulomb * float(chance.uniform(1.5, 2.0)),
        "stribeck_velocity": float(chance.uniform(0.05, 0.15)),
    }
    return _simulated(
        "two_link_arm",
        EffectUse(effect="stribeck_friction", at="joint2", **sizes),
        seeds=ARM_SEEDS,
        cutoff=20.0,
        hidden="the fall of the friction with speed",
    )


def axis() -> Case:
    """The shipped axis with a torque ripple."""
    chance = np.random.default_rng(AXIS_SEEDS[0])
    size, angle = float(chance.uniform(4.0, 8.0)), float(chance.uniform(0.0, 2.0 * np.pi))
    sizes = {
        "cosine": size * float(np.cos(angle)),
        "sine": size * float(np.sin(angle)),
        "order": 2.0 * np.pi / float(chance.uniform(0.01, 0.02)),
    }
    return _simulated(
        "single_axis",
        EffectUse(effect="torque_ripple", at="joint1", **sizes),
        seeds=AXIS_SEEDS,
        cutoff=40.0,
        hidden="all of it: no tool but the diagnosis has a ripple among its terms",
    )


def _simulated(name: str, use: EffectUse, *, seeds: tuple[int, int], cutoff: float, hidden: str) -> Case:
    """A shipped robot with `use` hidden in it, moved by Exudyn."""
    nominal = load_robot(name)
    assert nominal.reference is not None
    moved = replace(simulate(nominal.with_effects(use), seed=seeds[0]), source=f"Exudyn, seed {seeds[0]}")
    other = nominal.with_effects(use).model_copy(update={"reference": _other_tempo(nominal)})
    held = replace(simulate(other, seed=seeds[1]), source=f"Exudyn, seed {seeds[1]}")
    listed = ", ".join(f"{key} {value:.4g}" for key, value in use.parameters.items())
    return Case(
        title=f"`{name}`, simulated by Exudyn",
        origin=f"hidden: `{use.effect}` at {use.at} ({listed}); held out: another motion and other noise",
        nominal=nominal,
        fitted=(moved,),
        held_out=(held,),
        cutoff=cutoff,
        rate=nominal.reference.sample_rate,
        known={f"{use.effect}@{use.at}.{key}": value for key, value in use.parameters.items()},
        truth="true",
        hidden=hidden,
    )


def _other_tempo(robot: Robot) -> object:
    """The reference motion with other frequencies and phases."""
    assert robot.reference is not None

    def changed() -> Iterator[MultiSine]:
        for motion in robot.reference.joints:  # type: ignore[union-attr]
            assert isinstance(motion, MultiSine)
            frequencies = tuple(OTHER_TEMPO * f for f in motion.frequencies)
            phases = tuple(p + 1.0 for p in motion.phases)
            yield motion.model_copy(update={"frequencies": frequencies, "phases": phases})

    return robot.reference.model_copy(update={"joints": tuple(changed())})


#: Cases by name.
CASES = {"emps": emps, "servo": servo, "arm": arm, "axis": axis}


def load_case(name: str) -> Case:
    """A case of `CASES`, its recordings read or simulated."""
    return CASES[name]()
