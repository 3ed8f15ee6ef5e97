"""Adaptive neural network control with unknown friction and payload: errors by period, with and without."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from benchmarks.evidence import number, table
from benchmarks.studies.robots import JOINTS, MILLI, lugre, rms, swinging, swings
from exudyn_model import simulate as exudyn_simulate
from reference_model.simulation import simulate
from robot_model import AdaptiveNetwork, ComputedTorque, EffectUse, Recording, Reference, Robot

__all__ = ["section"]

#: Swing [degrees], frequency [Hz], number of periods, the first of which fades in.
AMPLITUDE, FREQUENCY, PERIODS = 5.0, 0.05, 6
#: Gains of the law [1/s^2, 1/s], Stribeck speed of the friction [rad/s].
KP, KD, STRIBECK = 1.0, 2.0, 0.025
#: The payload unknown to the controller [kg], at the beam's tip, which carries 50 kg already.
PAYLOAD = 15.0
CENTRES, WIDTH, ADAPTATION = 21, 0.5, 0.5
LEAKAGE = 0.02

INTRODUCTION = """\
## [10] Adaptive neural network control

Martins and others proposed an adaptive network for the tracking control of space manipulators under
friction and payload. Here `kind = "adaptive_network"`: a network of Gaussian basis functions adds an
acceleration to computed torque; its weights are states of the controller that follow dW/dt = adaptation
(phi s - leakage W), which comes from a Lyapunov function ([page of robot files](../../docs/robot.md))
with the sigma modification. The positions of the centres, along the reference, and s = ed + (kd/2) e are
this project's own choices. In `reference_model/control/adaptive_network.py` and
`exudyn_model/control/nonlinear.py`."""


def section() -> str:
    """The complete section."""
    laws = {
        "computed torque": ComputedTorque(kp=KP, kd=KD),
        "network": _network(),
        "network, with leakage": _network(leakage=LEAKAGE),
        "network, 3 centres": _network(centres=3),
        "network, 5 times the adaptation": _network(adaptation=5 * ADAPTATION),
    }
    rows = []
    for name, law in laws.items():
        run = simulate(_robot(law), sensors=False, rtol=1e-7, atol=1e-9)
        rows.append([name, *_by_period(run)])
    headings = ("controller", *(f"period {k + 1}:" for k in range(PERIODS)))
    first, last = (float(rows[k][-1]) for k in (0, 1))
    text = (
        f"Flexible space robot, its controller knowing rigid bodies only; LuGre friction on a preload of 30 "
        f"N m "
        f"and {PAYLOAD:g} kg more than its 50 kg at the tip, both unknown to it; both joints swing by "
        f"{AMPLITUDE:g} degrees at {FREQUENCY:g} Hz. kp = {KP:g} 1/s^2, kd = {KD:g} 1/s; {CENTRES} "
        f"centres of "
        f"width {WIDTH:g}, adaptation {ADAPTATION:g} 1/s^2, leakage {LEAKAGE:g} s where there is one. "
        f"Tracking "
        f"of joint 2 by periods of {1 / FREQUENCY:g} s, mrad rms; in the last one the network leaves "
        f"{100 * last / first:.0f} % of the error without it."
    )
    return "\n\n".join([INTRODUCTION, text, table(headings, rows), _engines()])


def _network(**changes: float) -> AdaptiveNetwork:
    given = {"kp": KP, "kd": KD, "centres": CENTRES, "width": WIDTH, "adaptation": ADAPTATION}
    return AdaptiveNetwork.model_validate({**given, **changes})


def _robot(law: object, reference: Reference | None = None) -> Robot:
    swing = reference or swings(AMPLITUDE, FREQUENCY, PERIODS / FREQUENCY, rate=20.0)
    robot = swinging(lugre(STRIBECK), swing, law)
    heavy = {"effect": "payload", "at": "link2", "mass": PAYLOAD, "x": 6.0, "y": 0.0, "z": 0.0}
    return robot.with_effects(EffectUse.model_validate(heavy))


def _by_period(run: Recording) -> list[str]:
    error = run["joint2.reference_position"] - run["joint2.position"]
    edges = np.linspace(0, len(error) - 1, PERIODS + 1).astype(int)
    return [number(MILLI * rms(error[a:b])) for a, b in pairwise(edges)]


def _engines() -> str:
    robot = _robot(_network(adaptation=20.0, leakage=LEAKAGE), swings(2.0, 0.5, 2.0))
    own, other = simulate(robot, sensors=False), exudyn_simulate(robot, sensors=False)
    gap = max(float(np.abs(own[f"{j}.position"] - other[f"{j}.position"]).max()) for j in JOINTS)
    return (
        f"The engines differ by {gap:.1e} rad over 2 s of a swing of 2 degrees at 0.5 Hz with 40 times the "
        "adaptation."
    )
