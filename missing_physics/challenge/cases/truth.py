"""What is hidden in a case: everything that makes it, as data that can be sealed."""

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
    """Physics that the catalogue does not have.

    Attributes:
        kind: key of `foreign.KINDS`.
        joint: where it acts.
        other: the joint that drives it, for kinds that couple two.
        parameters: of the kind.
    """

    kind: str
    joint: str
    other: str = ""
    parameters: dict[str, float]


class Warming(Sealed):
    """The way of a joint's temperature, the same in both recordings.

    Attributes:
        joint: that warms.
        start, rise: temperature at time zero above the room's, and what is gained in the end [K].
        time: constant of the approach [s].
        noise, resolution: of the thermometer that records it [K].
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
        number: of the case; also the seed from which all of it is drawn.
        name: random name of its folder.
        shipped: name of the robot that was varied.
        family: how the physics hides.
        nominal: the machine without what is hidden; the robot file that the diagnosis gets is made of it,
            with the errors, tuning and omissions of the case.
        hidden: effects that `nominal` lacks.
        foreign: physics outside the catalogue.
        validation: reference motion of the second recording.
        noise_ratio: torque noise over what `noise_of` does at its joint; None leaves the noise.
        noise_of: the effect, hidden or not, that the torque noise is as large as.
        beams: flexible links bend as geometrically exact beams in the recordings.
        warming: of a joint with a thermometer, whether its friction minds or not.
        conditions: what the robot file says and leaves out, and how the torque was recorded.
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
        """What is hidden from the catalogue, as `ID@PLACE`."""
        return tuple(f"{use.effect}@{use.at}" for use in self.hidden)

    @property
    def noise_seeds(self) -> tuple[int, int]:
        """Seeds of the sensors' noise in the two recordings."""
        return 2 * self.number, 2 * self.number + 1


class Truth(Sealed):
    """All cases of a challenge.

    It is a function of the first number and of how many there are, `nonce` included: whoever knows these and
    has this program can draw it. What keeps it from a diagnosis is that the diagnosing process has neither.
    In the demo the nonce is random. It keeps its truth from being guessed out of its fingerprint.
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
    """SHA-256 of the whole truth in a fixed notation."""
    return hashlib.sha256(canonical(truth)).hexdigest()


def canonical(truth: Truth) -> bytes:
    """The truth as JSON with sorted keys: the same bytes for the same content."""
    return json.dumps(truth.model_dump(mode="json"), sort_keys=True, separators=(",", ":")).encode()
