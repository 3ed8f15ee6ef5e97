"""Modes against geometrically exact beam elements: number of modes, number of elements, and deflection.

The reference model describes bending by the linear modes of lumped finite elements. Exudyn's exact beam
elements use no modes and allow large deflections, and their mass is distributed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.cross_validation.gaps import exudyn_run, reference_run
from robot_model import Beam, Joint, Link, Recording, Reference, Robot
from robot_model.description.flexible import StrainGauge, TipBody, Tube

__all__ = ["ELEMENTS", "LOADS", "MODES", "Bent", "by_elements", "by_load", "by_modes", "mast"]

Array = NDArray[np.float64]

#: Step of Exudyn [s]: 1/400 of the first period of 1.1 s.
STEP = 2.5e-3
LENGTH = 2.0
#: Kept modes, in pairs of equal frequency; elements; gravity across the mast [m/s^2].
MODES = (2, 4, 6, 10)
ELEMENTS = (4, 8, 16)
LOADS = (0.1, 1.0, 4.0, 10.0, 20.0, 40.0)
#: Load of the studies of modes and elements, of less than 0.1 % deflection.
SMALL = 0.1


@dataclass(frozen=True)
class Bent:
    """One comparison.

    Attributes:
        value: of the varied quantity.
        deflection: peak of the tip's transverse deflection over the length.
        across: difference of transverse deflections over their peak.
        along: difference of the tip's shift along the mast over the length.
        strain: difference of the strains near the root over their peak.
    """

    value: float
    deflection: float
    across: float
    along: float
    strain: float


def mast(*, load: float, modes: int, elements: int, tip: float = 3.0, duration: float = 0.6) -> Robot:
    """A level beam welded to the ground, released in a transverse field; the run covers its first swing."""
    beam = Beam(
        length=LENGTH,
        section=Tube(outer_diameter=0.03, inner_diameter=0.026),
        young=70e9,
        shear=27e9,
        density=2700.0,
        elements=elements,
        modes=modes,
        tip=TipBody(mass=tip),
        gauges=(StrainGauge(place=LENGTH / elements / 2, normal=(0.0, 1.0), distance=0.015),),
    )
    return Robot(
        name="mast",
        gravity=(0.0, 0.0, -load),
        links=(Link(name="pole", beam=beam),),
        joints=(Joint(name="foot", kind="fixed", parent="base", child="pole"),),
        reference=Reference(duration=duration, sample_rate=24 / duration),
    )


def by_modes() -> list[Bent]:
    """Increasing numbers of modes of a bare beam, against the same exact elements."""
    bare = {"load": SMALL, "elements": 24, "tip": 0.0, "duration": 0.12}
    exact = exudyn_run(mast(modes=2, **bare), flexible="beam", step=STEP / 4)
    return [_bent(n, mast(modes=n, **bare), exact) for n in MODES]


def by_elements() -> list[Bent]:
    """The same number of elements in both."""
    found = []
    for n in ELEMENTS:
        robot = mast(load=SMALL, modes=8, elements=n)
        found.append(_bent(n, robot, exudyn_run(robot, flexible="beam", step=STEP)))
    return found


def by_load() -> list[Bent]:
    """From small deflections to large ones, with enough elements and modes."""
    found = []
    for load in LOADS:
        robot = mast(load=load, modes=8, elements=16)
        found.append(_bent(load, robot, exudyn_run(robot, flexible="beam", step=STEP)))
    return found


def _bent(value: float, robot: Robot, exact: Recording) -> Bent:
    modal = reference_run(robot, rtol=1e-10, atol=1e-12)
    z, x = (np.array([run[f"pole.tip_deflection.{axis}"] for run in (modal, exact)]) for axis in "zx")
    peak = float(np.abs(z[1]).max())
    return Bent(
        value,
        peak / LENGTH,
        float(np.abs(z[0] - z[1]).max()) / peak,
        float(np.abs(x[0] - x[1]).max()) / LENGTH,
        _share(*(run["pole.strain.1"] for run in (modal, exact))),
    )


def _share(first: Array, second: Array) -> float:
    return float(np.abs(first - second).max() / np.abs(second).max())
