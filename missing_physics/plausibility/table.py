"""Table of credible values: parameter, range, reason and source.

A parameter that is not listed has the range of its catalogue entry. Values that depend on the robot or on the
recording (gravity, saturation, inertias) are judged in `judgement`.
"""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["INERTIAL_CHANGE", "SATURATION", "TABLE", "Credible", "credible_range"]


@dataclass(frozen=True)
class Credible:
    """A credible range.

    Attributes:
        effect, parameter: of the catalogue.
        quantity: last part of the channel to which it applies, such as `position`; "" for any place.
        low, high: the range, in `unit`.
        unit: of the parameter.
        reason: why values beyond it are not credible, as a clause for the user.
        source: where the reason comes from.
    """

    effect: str
    parameter: str
    quantity: str
    low: float
    high: float
    unit: str
    reason: str
    source: str


#: Largest delay of an encoder [s]: it is read in every cycle of its drive or bus and is delayed by a few
#: cycles, not by tens of milliseconds.
ENCODER_DELAY = 5e-3
#: Largest delay of a torque sensor or a current [s]: filters of 10 Hz and up, in second order, and buses.
TORQUE_DELAY = 0.05
ENCODERS = "encoders are read in every cycle of a drive or bus and are a few milliseconds late at most"
CYCLES = (
    "Cycles of encoder terminals on EtherCAT: 0.07 to 0.5 ms (Beckhoff EL5102, EL5131); of robot "
    "controllers: 1 to 2 ms (Doosan, Universal Robots). Two cycles and a filter: engineering judgement."
)

TABLE: tuple[Credible, ...] = (
    Credible(
        "sensor_gain",
        "gain_error",
        "position",
        -1e-4,
        1e-4,
        "-",
        "an encoder counts whole lines per turn, so that its scale is off by 1e-4 at most",
        "Lines per turn are counted; a linear scale of steel expands by 1e-5 per kelvin, over ten kelvin by "
        "1e-4.",
    ),
    Credible(
        "sensor_gain",
        "gain_error",
        "torque",
        -0.1,
        0.1,
        "-",
        "a torque sensor or current sensor is calibrated to a few percent, at worst to a tenth",
        "Joint torque sensors: 0.5 to 5 % of full scale; current sensors with shunt: 1 to 3 %.",
    ),
    Credible(
        "sensor_gain",
        "gain_error",
        "angular_velocity",
        -0.05,
        0.05,
        "-",
        "a gyro's scale is off by a few percent at most",
        "Micromechanical gyros without calibration: 1 to 3 %; fibre-optic ones: below 0.1 %.",
    ),
    Credible(
        "load_dependent_friction",
        "gear_share",
        "",
        0.0,
        0.7,
        "-",
        "a gear passes on at least a third of the torque that it gets; one that takes all of it explains any "
        "torque",
        "Efficiencies of data sheets: planetary 0.7 to 0.95, harmonic 0.6 to 0.85, worm 0.3 to 0.9.",
    ),
    Credible(
        "torque_gain",
        "gain_error",
        "",
        -0.2,
        0.2,
        "-",
        "torque constants scatter by up to a tenth between motors and fall by about 0.1 % per kelvin, by "
        "another tenth in a hot motor",
        "Motor data sheets (maxon, Kollmorgen): tolerance of the torque constant 5 to 10 %; NdFeB magnets "
        "-0.11 % per kelvin.",
    ),
    Credible(
        "sensor_delay",
        "delay",
        "position",
        0.0,
        ENCODER_DELAY,
        "s",
        ENCODERS,
        CYCLES,
    ),
    Credible(
        "sensor_delay",
        "delay",
        "motor_position",
        0.0,
        ENCODER_DELAY,
        "s",
        ENCODERS,
        CYCLES,
    ),
    Credible(
        "contact",
        "stiffness",
        "",
        1e3,
        1e13,
        "N/m^1.5",
        "even soft foam resists a fingertip with 1e3 N/m^1.5, and a force that grows more slowly is no wall",
        "Hertz: 4/3 E sqrt(R) with a radius of 1 cm and E = 1e4 Pa, softer than upholstery foam: engineering "
        "judgement.",
    ),
    Credible(
        "clock_drift",
        "rate",
        "",
        -1e-3,
        1e-3,
        "s/s",
        "clocks that keep a recording's time run on crystals, off by less than a thousandth",
        "Survey of some 20,000 hosts on the Internet: the median clock is off by 78 parts per million, some "
        "by more than 500 (D. L. Mills, Computer Network Time Synchronization, CRC Press 2006). Processors "
        "without a crystal are off by 1 % (data sheet of STM32L162) and keep no time of a recording: "
        "engineering judgement.",
    ),
)

#: Relative standard deviation of a nominal mass property: CAD models lack cables, screws and grease.
#: Engineering judgement.
INERTIAL_CHANGE = 0.3
#: Smallest credible torque limit of an actuator, as a fraction of the torque that the recorded motion
#: required: nominal masses are wrong by a third at most (credible change of inertial parameters), and so is
#: that torque.
SATURATION = 0.7


def credible_range(effect: str, parameter: str, place: str) -> Credible | None:
    """The table's row for a parameter of an effect at a place, or None."""
    quantities = place.split(".")[1:]
    for row in TABLE:
        if (row.effect, row.parameter) == (effect, parameter) and row.quantity in ("", *quantities):
            return row
    return None
