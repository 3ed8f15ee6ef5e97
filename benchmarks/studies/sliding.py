"""Variable structure control at low speed with stick-slip: layers and reaching laws."""

from __future__ import annotations

import numpy as np

from benchmarks.evidence import number, table
from benchmarks.studies.robots import JOINTS, MILLI, above, lugre, rms, swinging, swings
from exudyn_model import simulate as exudyn_simulate
from reference_model.simulation import simulate
from robot_model import ComputedTorque, Recording, SlidingMode

__all__ = ["section"]

#: Swing [degrees], frequency [Hz], length [s]: at most 0.6 mrad/s, far below the Stribeck speed [rad/s].
AMPLITUDE, FREQUENCY, DURATION, STRIBECK = 0.2, 0.025, 80.0, 2e-3
#: Slope of the sliding line [1/s], rate [rad/s^2], proportional [1/s].
SLOPE, RATE, PROPORTIONAL = 1.0, 0.05, 2.0
LAYERS = (0.05, 0.01, 0.002)
#: Speed below which a joint counts as resting [rad/s].
RESTING = 1e-5

INTRODUCTION = """\
## [11] Sliding mode control at low speed

Xue and others derived a low-speed friction model of a space robot and gave it two variable structure
controllers; their equations could not be read. Here `kind = "sliding_mode"`: computed torque with the
rigid nominal model, the sliding variable s = ed + slope e, a boundary layer, and the reaching laws of Gao
and Hung (1993), constant rate and constant plus proportional rate (`exponential`). In
`reference_model/control/sliding_mode.py` and `exudyn_model/control/nonlinear.py`."""


def section() -> str:
    """The complete section."""
    rows = []
    runs = {"computed torque, kp = 1, kd = 2": ComputedTorque(kp=1.0, kd=2.0)}
    for reaching in ("constant", "exponential"):
        for layer in LAYERS:
            given = {"reaching": reaching, "boundary_layer": layer}
            if reaching == "exponential":
                given["proportional"] = PROPORTIONAL
            runs[f"sliding, {reaching}, layer {layer:g} rad/s"] = SlidingMode(slope=SLOPE, rate=RATE, **given)
    for name, controller in runs.items():
        robot = swinging(lugre(STRIBECK), swings(AMPLITUDE, FREQUENCY, DURATION), controller)
        rows.append([name, *_cells(simulate(robot, sensors=False, rtol=1e-7, atol=1e-10))])
    headings = (
        *("controller", "tracking of joints 1, 2, mrad rms:", "largest, mrad:", "at rest, %:"),
        *("torque above 2 Hz, N m rms:", "tip above 0.5 Hz, mm rms:"),
    )
    text = (
        f"Flexible space robot, LuGre friction on a preload of 30 N m with a Stribeck speed of "
        f"{MILLI * STRIBECK:g} mrad/s; both joints swing by {AMPLITUDE:g} degree at {FREQUENCY:g} Hz. Slope "
        f"{SLOPE:g} 1/s, rate {RATE:g} rad/s^2, which is above what friction makes of the joints, "
        f"proportional {PROPORTIONAL:g} 1/s."
    )
    return "\n\n".join([INTRODUCTION, text, table(headings, rows), _reading(rows), _engines()])


def _reading(rows: list[list[str]]) -> str:
    wide, narrow = rows[1][1], rows[3][1]
    return (
        "The widest layer is computed torque with the same gains, and its joints rest in the dead band of "
        "friction. From the widest to the narrowest layer the constant law's tracking error goes from "
        f"{wide} to {narrow} mrad. The layer is a gain, rate/layer: the narrower, the less the joints rest "
        "and the more of the torque is high frequency; the link shakes as soon as joints stick and slip. "
        "The proportional part shortens the way to the layer and adds to the gain inside it."
    )


def _cells(run: Recording) -> list[str]:
    errors = [MILLI * (run[f"{j}.reference_position"] - run[f"{j}.position"]) for j in JOINTS]
    late = run.time > 1 / FREQUENCY
    resting = np.mean(np.abs(run["joint1.velocity"][late]) < RESTING)
    tip = np.hypot(*(above(run, f"link2.tip_deflection.{axis}", 0.5) for axis in "yz"))
    return [
        ", ".join(number(rms(error[late])) for error in errors),
        number(max(float(np.abs(error[late]).max()) for error in errors)),
        f"{100 * resting:.0f}",
        number(rms(above(run, "joint1.torque", 2.0)[late])),
        number(MILLI * rms(tip[late])),
    ]


def _engines() -> str:
    gaps = []
    for reaching in ("constant", "exponential"):
        given = {"proportional": PROPORTIONAL} if reaching == "exponential" else {}
        law = SlidingMode(slope=SLOPE, rate=RATE, boundary_layer=0.01, reaching=reaching, **given)
        robot = swinging(lugre(STRIBECK), swings(2.0, 0.5, 2.0), law)
        own, other = simulate(robot, sensors=False), exudyn_simulate(robot, sensors=False)
        gaps.append(max(float(np.abs(own[f"{j}.position"] - other[f"{j}.position"]).max()) for j in JOINTS))
    first, second = gaps
    return (
        f"The engines differ by {first:.1e} (constant) and {second:.1e} rad (exponential) over 2 s of a "
        f"swing "
        "of 2 degrees at 0.5 Hz in a layer of 0.01 rad/s."
    )
