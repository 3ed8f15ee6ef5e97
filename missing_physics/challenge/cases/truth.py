"""Truth of a challenge: the complete definition of its cases, as data that can be sealed."""

from __future__ import annotations

import hashlib
import json

from missing_physics.challenge.cases.conditions import Conditions, Sealed
from missing_physics.challenge.cases.families import Family
from robot_model import EffectUse, Reference, Robot

__all__ = ["SCHEMA", "Design", "Foreign", "Truth", "Warming", "canonical", "commitment"]

#: Version of the draws.
SCHEMA = 2


class Foreign(Sealed):
    """Physics outside the catalogue.

    Attributes:
        kind: key of `foreign.KINDS`.
        joint: joint at which it acts.
        other: the joint that drives it, for kinds that couple two joints.
        parameters: parameters of the kind.
    """

    kind: str
    joint: str
    other: str = ""
    parameters: dict[str, float]


class Warming(Sealed):
    """Temperature of a joint over time, the same in both recordings.

    Attributes:
        joint: the joint that warms up.
        start, rise: initial temperature above ambient, and total rise [K].
        time: time constant of the rise [s].
        noise, resolution: noise and resolution of the thermometer [K].
    """

    joint: str
    start: float
    rise: float
    time: float
    noise: float
    resolution: float


class Design(Sealed):
    """One case, before anything is simulated; drawn from its number alone.

    Attributes:
        number: number of the case, and the seed from which all of it is drawn.
        name: random name of its folder.
        shipped: name of the shipped robot that is varied.
        family: the way in which the physics is hidden.
        nominal: the machine without the hidden physics; the robot file for the diagnosis is derived from it,
            with the errors, tuning and omissions of the case.
        hidden: effects that `nominal` lacks.
        foreign: physics outside the catalogue.
        validation: reference motion of the held-out recording.
        noise_ratio: torque noise relative to the torque of `noise_of` at its joint; None leaves the noise.
        noise_of: the effect, hidden or not, that sets the torque noise.
        beams: flexible links are simulated as geometrically exact beams.
        warming: temperature of a joint with a thermometer, whether its friction depends on it or not.
        conditions: contents of the robot file, and the way in which the torque is recorded.
    """

    number: int
    name: str
    shipped: str
    family: Family
    nominal: Robot
    hidden: tuple[EffectUse, ...] = ()
    foreign: Foreign | None = None
    validation: Reference
    noise_ratio: float | None = None
    noise_of: EffectUse | None = None
    beams: bool = False
    warming: Warming | None = None
    conditions: Conditions = Conditions()

    @property
    def real(self) -> Robot:
        """The robot that is recorded."""
        return self.nominal.with_effects(*self.hidden)

    @property
    def labels(self) -> tuple[str, ...]:
        """Hidden effects of the catalogue, as `ID@PLACE`."""
        return tuple(f"{use.effect}@{use.at}" for use in self.hidden)

    @property
    def noise_seeds(self) -> tuple[int, int]:
        """Seeds of the sensors' noise in the two recordings."""
        return 2 * self.number, 2 * self.number + 1


class Truth(Sealed):
    """All cases of a challenge.

    It is a function of the first number and the number of cases, `nonce` included: whoever knows these and
    has this program can draw it. The diagnosing process has neither.
    In the demo the nonce is random, so that the truth cannot be guessed from its fingerprint.
    """

    schema_version: int = SCHEMA
    nonce: str
    designs: tuple[Design, ...]

    def design(self, name: str) -> Design:
        """The case of that folder name; raises KeyError."""
        for design in self.designs:
            if design.name == name:
                return design
        raise KeyError(name)


def commitment(truth: Truth) -> str:
    """SHA-256 of the truth in canonical form."""
    return hashlib.sha256(canonical(truth)).hexdigest()


def canonical(truth: Truth) -> bytes:
    """The truth as canonical JSON with sorted keys."""
    return json.dumps(truth.model_dump(mode="json"), sort_keys=True, separators=(",", ":")).encode()
