"""Conditions of a case: contents of the robot file, and the way in which the torque is recorded.

They are independent of the hidden physics, as on real machines, so the two are crossed: the conditions
depend on the case number by a permutation of their own. Every block of 64 cases of one parity contains
each combination of the five factors once, which keeps every fraction near its nominal value in a few hundred
cases, and in either half of them.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product
from types import MappingProxyType
from typing import Literal, get_args

import numpy as np
from pydantic import BaseModel, ConfigDict

from missing_physics.challenge.cases.ranges import Draw

__all__ = ["TORQUES", "Conditions", "Factors", "Sealed", "TorqueRecord", "draw_torque_record", "factors_of"]

TorqueKind = Literal["command", "measured", "delayed", "filtered"]
TORQUES: tuple[TorqueKind, ...] = get_args(TorqueKind)

#: Delay of a command that is logged late [samples]: the log's bus is read once per sample, so that a value
#: is between a half and one sample old.
LATE = (0.5, 1.0)
#: Corner frequency of the low-pass before a measured current is logged [fraction of the sampling rate]:
#: an anti-aliasing filter. Its delay at low frequencies stays below 1.5 samples.
CORNER = (0.15, 0.4)
#: Orders of that filter: first-order, or second-order Butterworth.
ORDERS = (1, 2)


class Sealed(BaseModel):
    """Data that is sealed with the truth."""

    model_config = ConfigDict(frozen=True, extra="forbid")


class TorqueRecord(Sealed):
    """Contents of the torque channels.

    Attributes:
        kind: "command": the controller's command, free of noise; "measured": the torque from the motor's
            current, with noise; "delayed": the command, logged late; "filtered": the torque from the
            current behind a low-pass, noise included.
        delay: delay of a delayed command [s].
        order, corner: order [-] and corner frequency [Hz] of the Butterworth filter; order 0 means none.
    """

    kind: TorqueKind = "measured"
    delay: float = 0.0
    order: int = 0
    corner: float = 0.0

    @property
    def digital(self) -> bool:
        """Whether a command from the controller's memory is recorded, to which only rounding is added."""
        return self.kind in ("command", "delayed")


class Factors(Sealed):
    """The factors that are crossed with the hidden physics.

    Attributes:
        file_exact: masses, inertias and friction of the robot file are correct.
        controller_known: the robot file has controller and reference, the recordings have reference
        positions.
        held: the controller holds its command between the ticks of its clock (zero-order hold).
        noise_stated: the robot file states noise and resolution of the sensors.
        torque: contents of the torque channels.
    """

    file_exact: bool = True
    controller_known: bool = True
    held: bool = False
    noise_stated: bool = True
    torque: TorqueKind = "measured"


class Conditions(Sealed):
    """The factors of a case and the numbers that were drawn for them.

    Attributes:
        factors: combination of the factors.
        file_errors: relative error of each number of the robot file, see `file_errors`; empty if exact.
        torque: how the torque was recorded.
    """

    factors: Factors = Factors()
    file_errors: dict[str, float] = {}
    torque: TorqueRecord = TorqueRecord()

    @property
    def words(self) -> Mapping[str, str]:
        """Level of each factor, for tables."""
        factors = self.factors
        filtered = {0: "", 1: " (first order)", 2: " (Butterworth)"}[self.torque.order]
        return MappingProxyType(
            {
                "robot file": "exact" if factors.file_exact else "off by 1 to 10 %",
                "controller": "in the file" if factors.controller_known else "not in the file",
                "command": "held" if factors.held else "continuous",
                "noise": "stated" if factors.noise_stated else "not stated",
                "torque": f"{factors.torque}{filtered}",
            }
        )


#: Every combination of the factors.
CELLS = tuple(
    Factors(file_exact=file, controller_known=controller, held=held, noise_stated=noise, torque=torque)
    for file, controller, held, noise in product((True, False), repeat=4)
    for torque in TORQUES
)


def factors_of(number: int) -> Factors:
    """The factors of a case: any 64 consecutive cases of one parity have different combinations."""
    block, place = divmod(number // 2, len(CELLS))
    order = np.random.default_rng([block, number % 2, 37]).permutation(len(CELLS))
    return CELLS[int(order[place])]


def draw_torque_record(kind: TorqueKind, rate: float, d: Draw) -> TorqueRecord:
    """How a torque of that kind is recorded at `rate` samples per second [Hz]."""
    if kind == "delayed":
        return TorqueRecord(kind=kind, delay=d.even(*LATE) / rate)
    if kind == "filtered":
        order = ORDERS[int(d.chance.integers(len(ORDERS)))]
        return TorqueRecord(kind=kind, order=order, corner=d.decades(*CORNER) * rate)
    return TorqueRecord(kind=kind)
