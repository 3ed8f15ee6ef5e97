"""Temperature-dependent friction: cold, warm, and with self-heating."""

from __future__ import annotations

from math import log, radians

import numpy as np

from benchmarks.evidence import number, table
from benchmarks.friction.cases import MU_KINETIC, MU_STATIC, PRELOAD
from exudyn_model import simulate as exudyn_simulate
from reference_model.simulation import simulate
from robot_model import Cycloid, EffectUse, MultiSine, Recording, Reference, Robot, load_robot

__all__ = ["section", "warmed"]

MILLI = 1e3
JOINTS = ("joint1", "joint2")
#: Temperatures between which static friction changes by a factor of 5 and kinetic friction by 10 [K].
COLD, WARM = 223.0, 373.0
STATIC_RATE, KINETIC_RATE = log(5) / (WARM - COLD), log(10) / (WARM - COLD)
#: Reference temperature of the friction in this study [K].
REFERENCE = 293.15
#: Viscous friction at the reference temperature [N m s/rad], and speed at which static friction has vanished
#: [rad/s].
VISCOUS, FALL = 40.0, 2e-3
#: Joint with self-heating: capacity [J/K], resistance [K/W], with a time constant of 200 s.
CAPACITY, RESISTANCE = 20.0, 10.0

INTRODUCTION = f"""\
## [4] Temperature

Ambrose and Askew measured the joints of a space robot over {COLD:g} to {WARM:g} K: static friction rose
by a factor of 5, kinetic friction, mapped as torque against speed, by 10 or more. A joint's `thermal`
table gives its temperature (constant, a table, or a heat capacity heated by friction) and two rates:
static friction is multiplied by exp(-static_rate (T - T0)), kinetic friction by exp(-kinetic_rate (T -
T0)). The exponentials are ours; the two factors fix the rates, {STATIC_RATE:.5f} and {KINETIC_RATE:.5f}
1/K. In `reference_model/joint/temperature.py` and `exudyn_model/effects/thermal.py`."""


def section() -> str:
    """The complete section."""
    return "\n\n".join([INTRODUCTION, _cold_and_warm(), _warming()])


def warmed(robot: Robot, temperature: dict) -> Robot:
    """The robot with all moving joints at that temperature, and this study's rates."""
    thermal = {
        "reference": REFERENCE,
        "static_rate": STATIC_RATE,
        "kinetic_rate": KINETIC_RATE,
        "temperature": temperature,
    }
    data = robot.model_dump()
    for joint in data["joints"]:
        joint["thermal"] = thermal
    return Robot.model_validate(data)


def _cold_and_warm() -> str:
    rows, found = [], {}
    for kelvin in (COLD, 258.0, REFERENCE, 333.0, WARM):
        run = simulate(_slow(kelvin), sensors=False, rtol=1e-7, atol=1e-9)
        found[kelvin] = _levels(run)
        error = run["joint1.reference_position"] - run["joint1.position"]
        twin = exudyn_simulate(_slow(kelvin).model_copy(update={"reference": _short()}), sensors=False)
        own = simulate(_slow(kelvin).model_copy(update={"reference": _short()}), sensors=False)
        gap = np.abs(own["joint1.position"] - twin["joint1.position"]).max()
        static, kinetic = found[kelvin]
        rows.append(
            [
                f"{kelvin:g}",
                number(static),
                number(kinetic),
                number(MILLI * np.sqrt(np.mean(error**2))),
                number(MILLI * abs(error[-1])),
                f"{gap:.1e}",
            ]
        )
    headings = (
        *("temperature, K:", "largest at break-away, N m:", "sliding at 20 mrad/s, N m:"),
        *("tracking of joint 1, mrad rms:", "left at the end, mrad:", "engines apart over 1 s, rad:"),
    )
    static, kinetic = (found[COLD][k] / found[WARM][k] for k in range(2))
    text = (
        "Flexible space robot with a preload of "
        f"{PRELOAD:g} N m; Stribeck friction of {MU_KINETIC * PRELOAD:g} to {MU_STATIC * PRELOAD:g} N m and "
        f"viscous friction of {VISCOUS:g} N m s/rad at {REFERENCE:g} K; joint 1 turns by 10 degrees in 16 s. "
        f"From {WARM:g} to {COLD:g} K the friction at break-away grows by {static:.3g} and that of sliding "
        f"by "
        f"{kinetic:.3g}. Below the temperature at which both are equal, static friction is the smaller one, "
        f"as "
        "these factors have it: cold joints do not stick and slip, they drag."
    )
    return f"{text}\n\n{table(headings, rows)}"


def _warming() -> str:
    robot = _swinging()
    run = simulate(robot, sensors=False, rtol=1e-7, atol=1e-9)
    twin = exudyn_simulate(
        robot.model_copy(update={"reference": robot.reference.model_copy(update={"duration": 40.0})}),
        sensors=False,
    )
    rows = []
    for start in (0, 100, 300, 700):
        part = slice(start * 10, start * 10 + 200)
        power = -run["joint1.friction_torque"][part] * run["joint1.velocity"][part]
        error = run["joint1.reference_position"][part] - run["joint1.position"][part]
        rows.append(
            [
                f"{start} to {start + 20}",
                number(float(np.mean(run["joint1.temperature"][part]))),
                number(float(np.mean(power))),
                number(float(np.abs(run["joint1.friction_torque"][part]).max())),
                number(float(MILLI * np.sqrt(np.mean(error**2)))),
            ]
        )
    headings = (
        *("time, s:", "temperature, K:", "power of friction, W:", "largest friction, N m:"),
        "tracking, mrad rms:",
    )
    rise = run["joint1.temperature"][-1] - COLD
    gap = np.abs(twin["joint1.temperature"] - run["joint1.temperature"][: len(twin.time)]).max()
    text = (
        f"A joint that warms itself: the two-link arm in weightlessness at {COLD:g} K swings by 0.8 rad at "
        f"0.25 Hz for 800 s, each joint with {CAPACITY:g} J/K and {RESISTANCE:g} K/W. Joint 1 warms by "
        f"{rise:.3g} K, and its friction falls as it does. The engines' temperatures differ by {gap:.1e} K "
        "over the first 40 s."
    )
    return f"{text}\n\n{table(headings, rows)}"


def _levels(run: Recording) -> tuple[float, float]:
    """Largest friction of joint 1 before it moves, and friction at its largest speed [N m]."""
    friction, speed = np.abs(run["joint1.friction_torque"]), np.abs(run["joint1.velocity"])
    moving = int(np.argmax(speed > FALL))
    return float(friction[:moving].max()), float(np.interp(0.02, *_rising(speed, friction)))


def _rising(speed: np.ndarray, friction: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Speed and friction up to the largest speed, by speed."""
    order = np.argsort(speed[: int(np.argmax(speed)) + 1])
    return speed[order], friction[order]


def _slow(kelvin: float) -> Robot:
    robot = load_robot("flexible_space_robot")
    levels = {"coulomb_torque": MU_KINETIC * PRELOAD, "static_torque": MU_STATIC * PRELOAD}
    laws = (
        {"effect": "stribeck_friction", **levels, "stribeck_velocity": FALL},
        {"effect": "viscous_friction", "coefficient": VISCOUS},
    )
    effects = tuple(EffectUse.model_validate({**law, "at": joint}) for law in laws for joint in JOINTS)
    turned = Cycloid(joint="joint1", displacement=radians(10), start=0.5, duration=16.0)
    reference = Reference(duration=18.0, sample_rate=100.0, joints=(turned,))
    changes = {"reference": reference, "sensors": (), "effects": effects}
    return warmed(robot.model_copy(update=changes), {"kind": "constant", "value": kelvin})


def _short() -> Reference:
    turned = Cycloid(joint="joint1", displacement=radians(2), duration=1.0)
    return Reference(duration=1.0, sample_rate=100.0, joints=(turned,))


def _swinging() -> Robot:
    robot = load_robot("two_link_arm")
    levels = {"coulomb_torque": 0.6, "static_torque": 0.9, "stribeck_velocity": 0.02}
    laws = (
        {"effect": "stribeck_friction", **levels},
        {"effect": "viscous_friction", "coefficient": 0.5},
    )
    effects = tuple(EffectUse.model_validate({**law, "at": joint}) for law in laws for joint in JOINTS)
    waves = {"amplitudes": (0.8,), "frequencies": (0.25,), "ramp": 2.0}
    joints = tuple(MultiSine(joint=name, **waves) for name in JOINTS)
    changes = {
        "reference": Reference(duration=800.0, sample_rate=10.0, joints=joints),
        "gravity": (0.0, 0.0, 0.0),
        "sensors": (),
        "effects": effects,
    }
    heat = {"kind": "self_heating", "ambient": COLD, "capacity": CAPACITY, "resistance": RESISTANCE}
    return warmed(robot.model_copy(update=changes), heat)
