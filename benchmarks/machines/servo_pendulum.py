"""What a diagnosis makes of a hobby servo, scored by free runs on logs of a gain that was never fitted.

    python -m benchmarks.machines.servo_pendulum

writes `reports/evidence/servo_pendulum.md`. The logs come from the folder that `MISSING_PHYSICS_DATA` names,
or are downloaded.
"""

from __future__ import annotations

import datetime
import os
import platform
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path

import numpy as np

from benchmarks.machines.bam_rule import PUBLISHED, Log, run_log
from benchmarks.machines.servo_pendulum_text import DIAGNOSED, REGRESSION, Scores, mean_error, section
from missing_physics.diagnosis.free_run.numbers import REFERENCE_DELAY, with_numbers
from missing_physics.diagnosis.free_run.problem import Trial
from missing_physics.diagnosis.free_run.run import SUPPLY_CHANNEL, simulate_recording
from missing_physics.diagnosis.pipeline import Options, diagnose
from missing_physics.diagnosis.simulation.fit import effect_numbers
from missing_physics.diagnosis.simulation.refit import Refit, refit
from missing_physics.recordings import load_constants, load_recording, mapping_from_toml
from missing_physics.recordings.datasets import fetch_dataset
from missing_physics.results.result import Result
from robot_model import (
    EffectUse,
    Recording,
    Robot,
    VoltageServo,
    load_robot,
    robot_from_toml,
    write_atomically,
)

__all__ = ["main"]

ROOT = Path(__file__).resolve().parents[2]
EXAMPLE = ROOT / "examples" / "servo_pendulum"
REPORT = ROOT / "reports" / "evidence" / "servo_pendulum.md"
COMMAND = "python -m benchmarks.machines.servo_pendulum"

#: Gains whose logs are fitted, and the one whose logs are only scored.
FITTED, HELD_OUT = (100, 400), 200
#: Duty cycle per position error and unit of gain [1/rad]: encoder steps, divisor of the gain, full duty.
DUTY_PER_GAIN = (4096 / (2 * np.pi)) / (256 * 885)
#: Motions in the order in which they were recorded with each gain.
MOTIONS = ("sin_sin", "lift_and_drop", "up_and_down", "sin_time_square")
#: Channels of the logs that only this comparison needs.
MORE_CHANNELS = """
[channels."supply.voltage"]
source = "entries.input_volts"

[channels."register.velocity"]
source = "entries.speed"

[channels."register.position"]
source = "entries.goal_position"

[constants]
"""
#: Where refits start: small, so that no effect is given away.
STARTS: Mapping[str, Mapping[str, float]] = {
    "viscous_friction": {"coefficient": 5e-3},
    "coulomb_friction": {"torque": 1e-2},
    "stribeck_friction": {"coulomb_torque": 1e-2, "static_torque": 1.5e-2, "stribeck_velocity": 0.3},
    "load_dependent_friction": {"coefficient": 0.0, "gear_share": 0.1},
}
LADDER: Mapping[str, tuple[str, ...]] = {
    "no friction": (),
    "viscous": ("viscous_friction",),
    "Coulomb, viscous (M1)": ("coulomb_friction", "viscous_friction"),
    "Stribeck, viscous (M2)": ("stribeck_friction", "viscous_friction"),
    "load-dependent": ("load_dependent_friction",),
    "load-dependent, viscous": ("load_dependent_friction", "viscous_friction"),
    "load-dependent, Coulomb, viscous (M3)": (
        "load_dependent_friction",
        "coulomb_friction",
        "viscous_friction",
    ),
    "load-dependent, Stribeck, viscous (M4)": (
        "load_dependent_friction",
        "stribeck_friction",
        "viscous_friction",
    ),
}
#: A law is as good as the best when its error on the fitted gains is at most this many times as large.
AS_GOOD = 1.05
#: What a refit may change besides the friction.
BODY = ("pendulum.center_of_mass.x", "joint1.rotor_inertia")
MOTOR = ("joint1.torque_constant", "joint1.resistance")
CHOICES: Mapping[str, tuple[str, ...]] = {
    "friction only": (),
    "and offset, rotor": BODY,
    "and offset, rotor, R": (*BODY, MOTOR[1]),
    "and offset, rotor, kt": (*BODY, MOTOR[0]),
    "and offset, rotor, kt, R": (*BODY, *MOTOR),
    "and offset, rotor, R, supply": (*BODY, MOTOR[1], "controller.supply"),
    "and offset, rotor, kt, R, delay": (*BODY, *MOTOR, REFERENCE_DELAY),
}


@dataclass(frozen=True)
class ServoLog:
    """One log.

    Attributes:
        gain: of the firmware.
        motion: name of the reference.
        recording: all channels.
        rule: the same as the authors' rule needs it.
        controller: what was in force.
    """

    gain: int
    motion: str
    recording: Recording
    rule: Log
    controller: VoltageServo

    def trial(self, *, supply: bool) -> Trial:
        """For free runs, with the measured supply voltage or the nominal one."""
        return Trial(self.recording if supply else _without(self.recording, SUPPLY_CHANNEL), self.controller)

    @property
    def diagnosed(self) -> Recording:
        """The channels that a user's mapping gives."""
        return _without(self.recording, SUPPLY_CHANNEL, "register.velocity", "register.position")


def _without(recording: Recording, *channels: str) -> Recording:
    kept = {name: values for name, values in recording.channels.items() if name not in channels}
    return replace(recording, channels=kept)


def load_logs(folder: Path) -> list[ServoLog]:
    """All logs, in the order in which they were recorded."""
    text = (EXAMPLE / "map.toml").read_text("utf-8").replace("\n[constants]\n", MORE_CHANNELS, 1)
    mapping = mapping_from_toml(text, source="map.toml")
    logs = []
    for number, file in enumerate(sorted(folder.glob("xl330_*.json"))):
        # a register of speed in a unit of its own contradicts that of position
        recording = load_recording(file, mapping=mapping, check=False)
        constants = load_constants(file, mapping=mapping)
        servo = VoltageServo(gain=constants["position_gain"] * DUTY_PER_GAIN, supply=constants["supply"])
        logs.append(
            ServoLog(
                round(constants["position_gain"]),
                MOTIONS[number % len(MOTIONS)],
                recording,
                _rule_log(recording, constants),
                servo,
            )
        )
    return logs


def _rule_log(recording: Recording, constants: Mapping[str, float]) -> Log:
    return Log(
        time=recording.time - recording.time[0],
        position=recording["joint1.position"],
        speed=recording["register.velocity"],
        goal=recording["register.position"],
        on=np.isfinite(recording["joint1.reference_position"]),
        gain=constants["position_gain"] * DUTY_PER_GAIN,
        supply=constants["supply"],
        mass=constants["mass"],
        length=constants["length"],
    )


def free_run_errors(
    robot: Robot, logs: Sequence[ServoLog], *, supply: bool = False, reference_delay: float = 0.0
) -> list[float]:
    """Mean absolute position error of a free run along each log [mrad]."""
    found = []
    for log in logs:
        trial = log.trial(supply=supply)
        run = simulate_recording(
            robot, trial.recording, controller=trial.controller, reference_delay=reference_delay
        )
        found.append(1e3 * run.errors["joint1"].mean_absolute)
    return found


def rule_errors(name: str, logs: Sequence[ServoLog]) -> list[float]:
    """The same of a published model, stepped by its authors' rule."""
    pairs = [run_log(log.rule, PUBLISHED[name]) for log in logs]
    return [1e3 * float(np.abs(simulated - logged).mean()) for simulated, logged in pairs]


def _use(effect: str, **parameters: float) -> EffectUse:
    return EffectUse.model_validate({"effect": effect, "at": "joint1", **parameters})


def published_robot(nominal: Robot) -> Robot:
    """The published M1 as a robot: its angle offset turns the centre of mass about the axis."""
    p = PUBLISHED["M1"]
    friction = (
        _use("coulomb_friction", torque=p["base"]),
        _use("viscous_friction", coefficient=p["viscous"]),
    )
    length = float(np.linalg.norm(nominal.link("pendulum").center_of_mass))
    numbers = {
        "joint1.torque_constant": p["kt"],
        "joint1.resistance": p["R"],
        "joint1.rotor_inertia": p["armature"],
        "pendulum.center_of_mass.x": -length * float(np.sin(p["q_offset"])),
        "pendulum.center_of_mass.z": -length * float(np.cos(p["q_offset"])),
    }
    return with_numbers(nominal.with_effects(*friction), numbers)


def refitted(
    robot: Robot, logs: Sequence[ServoLog], more: Sequence[str] = (), *, supply: bool = False
) -> Refit:
    """Refit the effects of `robot`, and `more` numbers, to the fitted gains; scored on the other."""
    fitted = [log.trial(supply=supply) for log in logs if log.gain in FITTED]
    scored = [log.trial(supply=supply) for log in logs if log.gain == HELD_OUT]
    return refit(robot, fitted, scored, free=(*effect_numbers(robot), *more), starts=4, seed=0)


def with_friction(nominal: Robot, effects: Sequence[str]) -> Robot:
    """The nominal robot with these effects at their starts."""
    return nominal.with_effects(*(_use(e, **STARTS[e]) for e in effects))


def diagnosis_of(nominal: Robot, logs: Sequence[ServoLog], *, simulation: bool = True) -> Result:
    """The diagnosis from all logs of the fitted gains; it never gets those of the other gain."""
    return diagnose(
        nominal,
        [log.diagnosed for log in logs if log.gain in FITTED],
        options=Options(experiments=False, simulation=simulation),
    )


def score(nominal: Robot, logs: Sequence[ServoLog]) -> Scores:
    """Everything that the report shows."""
    held = [log for log in logs if log.gain == HELD_OUT]
    result = diagnosis_of(nominal, logs)
    alone = robot_from_toml(diagnosis_of(nominal, logs, simulation=False).augmented_robot_toml)
    ladder = {name: refitted(with_friction(nominal, e), logs, (*BODY, *MOTOR)) for name, e in LADDER.items()}
    law = chosen_law(ladder)
    robots = {
        "nominal: ideal motor, no friction": nominal,
        REGRESSION: alone,
        DIAGNOSED: robot_from_toml(result.augmented_robot_toml),
        f"{law}: from the table below, with offset, rotor, kt, R": ladder[law].robot,
        "published M1, in our simulator": published_robot(nominal),
    }
    runs = {name: free_run_errors(robot, held) for name, robot in robots.items()}
    runs |= {f"published {name}, by its authors' rule": rule_errors(name, held) for name in PUBLISHED}
    chosen = with_friction(nominal, LADDER[law])
    constants = {name: refitted(chosen, logs, more) for name, more in CHOICES.items()}
    sagging = "and offset, rotor, kt, R; supply as measured"
    constants[sagging] = refitted(chosen, logs, (*BODY, *MOTOR), supply=True)
    measured = {name: free_run_errors(robot, held, supply=True) for name, robot in robots.items()}
    motions = tuple(log.motion for log in held)
    return Scores(result, motions, runs, measured, ladder, law, constants)


def chosen_law(ladder: Mapping[str, Refit]) -> str:
    """The friction law with fewest numbers among those that follow the fitted gains about best.

    Held-out logs have no part in the choice.
    """
    errors = {name: mean_error(done.training) for name, done in ladder.items()}
    good = [name for name, error in errors.items() if error <= AS_GOOD * min(errors.values())]
    return min(good, key=lambda name: len(ladder[name].parameters))


def main() -> None:
    """Compute everything and write the report."""
    logs = load_logs(fetch_dataset("servo_pendulum"))
    scores = score(load_robot(EXAMPLE / "nominal.toml"), logs)
    packages = ("casadi", "numpy", "scipy")
    versions = ", ".join(
        [f"Python {platform.python_version()}", *(f"{name} {version(name)}" for name in packages)]
    )
    machine = f"{platform.machine()}, {os.cpu_count()} cores"
    text = section(
        scores, date=datetime.date.today().isoformat(), versions=versions, machine=machine, command=COMMAND
    )
    write_atomically(REPORT, text)
    print(text)


if __name__ == "__main__":
    main()
