"""Two recordings of one motion, channel by channel, and the error band of each engine.

The true motion is not known, but every engine can be run again with a coarser step. For a second-order
method, the run at twice the step has four times the error, so the difference between the two runs is three
times the
error of the finer one: as an error bound it has the safety factor 3 that P. Roache recommends if only two
grids are available (J. Fluids Eng. 116 (1994) 405-413). The reference runs again at larger tolerances, and
the difference bounds its error likewise. A difference between the engines inside the sum of the two bands is
one that the engines' own steps explain; one outside is a difference of modelling.

The bands are widened to their maximum over a window of `WINDOW` of the run: where the difference of two runs
crosses zero, neither is exact. They are never narrower than `SOLVED` times the largest value in the unit, the
accuracy to which both engines solve their equations.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d

from missing_physics.reporting.scene.skeleton import reach
from robot_model import InputError, Recording, Robot, unit_of

__all__ = ["WINDOW", "Comparison", "Difference", "compare"]

Array = NDArray[np.float64]

#: Width of the window over which a band takes its maximum, as a fraction of the run. Within half a second of
#: a run of four seconds, both runs of an engine were observed to cross, with errors of many times their
#: difference.
WINDOW = 0.2
#: A range below this fraction of the largest value, or of 1, is rounding and is not used as a scale.
FLAT = 1e-12
#: Fraction of the samples that may leave a band: coarser runs are compared at every other instant, and where
#: friction reverses a single sample between two of them may stand out.
FORGIVEN = 1e-3
#: Relative error to which the engines solve their equations: tolerance of the reference run, and of Newton's
#: iterations in Exudyn.
SOLVED = 1e-10


@dataclass(frozen=True)
class Difference:
    """Difference of two engines in one channel.

    Attributes:
        channel: native name.
        unit: of the channel.
        largest, rms: of the difference, in the channel's unit.
        time: of the largest [s].
        extent: range of the reference, in the channel's unit; 0 for a channel whose changes are only rounding
            or the engines' errors.
        bound: largest value of the band, in the channel's unit; None without a band.
        inside: fraction of the samples with the difference inside the band; None without a band.
        excess: largest difference over the band at that instant; None without a band.
    """

    channel: str
    unit: str
    largest: float
    rms: float
    time: float
    extent: float
    bound: float | None = None
    inside: float | None = None
    excess: float | None = None

    @property
    def relative_largest(self) -> float | None:
        """Largest difference over the channel's range; None for a constant channel."""
        return self.largest / self.extent if self.extent > 0 else None

    @property
    def relative_rms(self) -> float | None:
        """Root mean square over the channel's range; None for a constant channel."""
        return self.rms / self.extent if self.extent > 0 else None

    @property
    def severity(self) -> tuple[bool, float]:
        """Sort key of channels, the worst last: whether it leaves its band, and its excess.

        Without a band the difference over the channel's range is used instead of the excess.
        """
        if self.excess is None:
            return False, self.relative_largest or 0.0
        return self.explained is False, self.excess

    @property
    def explained(self) -> bool | None:
        """Whether the difference stays in the band except for `FORGIVEN` samples; None without a band."""
        return None if self.inside is None else self.inside >= 1.0 - FORGIVEN


@dataclass(frozen=True)
class Comparison:
    """Both recordings, their differences in the order of the reference, and the bands.

    Attributes:
        reference, exudyn: of the same instants.
        differences: of all channels that both have.
        bands: channel to the half width of its band, shape (N,); empty where no coarser runs were given.
    """

    reference: Recording
    exudyn: Recording
    differences: tuple[Difference, ...]
    bands: Mapping[str, Array] = field(default_factory=dict)

    @property
    def outside(self) -> tuple[Difference, ...]:
        """Channels that leave their band, the largest excess first."""
        found = [item for item in self.differences if item.explained is False]
        return tuple(sorted(found, key=lambda item: -(item.excess or 0.0)))

    @property
    def worst(self) -> Difference | None:
        """The channel with the largest excess, even if inside its band.

        Without bands the one with the largest difference over its range; None if no channel has a range.
        """
        known = [item for item in self.differences if self.bands or item.relative_largest is not None]
        return max(known, key=lambda item: item.severity, default=None)

    def difference(self, channel: str) -> Array:
        """Exudyn minus reference, shape (N,)."""
        gap: Array = self.exudyn[channel] - self.reference[channel]
        return gap


def compare(
    robot: Robot,
    reference: Recording,
    exudyn: Recording,
    coarser: Sequence[tuple[Recording, Recording]] = (),
) -> Comparison:
    """The differences of two recordings of `robot`.

    Args:
        robot: the description.
        reference, exudyn: of the same instants.
        coarser: pairs of an engine's recording and its coarser one, at some of the same instants; their
            differences are summed to the bands.

    Raises:
        InputError: the recordings have different instants.
    """
    for other in (exudyn, *(fine for fine, _ in coarser)):
        if not np.array_equal(reference.time, other.time):
            raise InputError(f"{reference.source} and {other.source} are sampled at different instants.")
    shared = [name for name in reference if name in exudyn]
    units = _units(robot, shared)
    scales = _scales(robot, reference, units)
    bands = {}
    if coarser:
        bands = {name: _band(name, coarser) + SOLVED * scales[_family(name, units[name])] for name in shared}
    found = [_difference(name, units[name], reference, exudyn, bands.get(name)) for name in shared]
    return Comparison(reference, exudyn, tuple(found), bands)


def _units(robot: Robot, channels: Sequence[str]) -> dict[str, str]:
    prismatic = {joint.name for joint in robot.moving_joints if joint.kind == "prismatic"}
    return {name: unit_of(name, prismatic=name.split(".")[0] in prismatic) for name in channels}


def _family(channel: str, unit: str) -> str:
    """Key of channels that share a scale: their unit, or their quantity if they have no unit."""
    return unit if unit != "-" else channel.split(".")[1]


def _scales(robot: Robot, reference: Recording, units: Mapping[str, str]) -> dict[str, float]:
    """Largest value of each family.

    Momenta are small differences of large contributions: their scale is the robot's mass times the speed of
    its outer end.
    """
    found: dict[str, float] = {}
    for name, unit in units.items():
        family = _family(name, unit)
        found[family] = max(found.get(family, 0.0), float(np.abs(reference[name]).max(initial=0.0)))
    beams = [link.beam for link in robot.links if link.beam]
    mass = sum(body.mass for body in (robot.base, *robot.links))
    mass += sum(beam.mass + beam.tip.mass for beam in beams)
    speed = max(found.get("m/s", 0.0), found.get("rad/s", 0.0) * reach(robot))
    for unit, parts in (("N s", mass * speed), ("N m s", mass * speed * reach(robot))):
        found[unit] = max(found.get(unit, 0.0), parts)
    return found


def _band(name: str, coarser: Sequence[tuple[Recording, Recording]]) -> Array:
    """Sum over the engines of the widest difference, fine less coarse, near each instant, shape (N,)."""
    whole = np.zeros(len(coarser[0][0]))
    for fine, coarse in coarser:
        if name in fine and name in coarse:
            places = np.searchsorted(fine.time, coarse.time)
            gaps = np.zeros(len(fine))
            gaps[places] = np.abs(coarse[name] - fine[name][places])
            half = max(round(WINDOW * len(fine) / 2), int(np.diff(places).max(initial=1)))
            whole += maximum_filter1d(gaps, 2 * half + 1, mode="nearest")
    return whole


def _difference(
    name: str, unit: str, reference: Recording, exudyn: Recording, band: Array | None
) -> Difference:
    first = reference[name]
    gap = np.abs(exudyn[name] - first)
    worst = int(np.argmax(gap))
    extent, size = float(np.ptp(first)), float(np.abs(first).max())
    bound = None if band is None else float(band.max())
    moves = extent > FLAT * max(size, 1.0) and extent > (bound or 0.0)
    return Difference(
        name,
        unit,
        largest=float(gap[worst]),
        rms=float(np.sqrt(np.mean(gap**2))),
        time=float(reference.time[worst]),
        extent=extent if moves else 0.0,
        bound=bound,
        inside=None if band is None else float(np.mean(gap <= band)),
        excess=None if band is None else float((gap / np.maximum(band, np.finfo(float).tiny)).max()),
    )
