"""Beams for the tests of flexible links, and the exact solutions they are compared with."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.optimize import brentq

from robot_model import Beam, Link, Section, Tube

__all__ = ["LENGTH", "beam_link", "bending_roots", "cantilever", "free_free", "slender", "squares_of"]

LENGTH = 2.0

#: So slender that rotary inertia, which Euler and Bernoulli leave out, raises no digit that is tested.
slender: Section = Tube(outer_diameter=0.001)


def beam_link(section: Section = slender, **keys: object) -> Link:
    """A link that consists only of a steel beam; `keys` are the beam's."""
    given = {"length": LENGTH, "young": 210e9, "shear": 80e9, "density": 7800.0, "elements": 24, "modes": 6}
    rigid = {key: keys.pop(key) for key in ("mass", "inertia", "center_of_mass") if key in keys}
    return Link(name="link1", beam=Beam(section=section, **{**given, **keys}), **rigid)  # type: ignore[arg-type]


def squares_of(beam: Beam, numbers: np.ndarray, *, second: float | None = None) -> np.ndarray:
    """Squares of the bending frequencies (k L)^4 EI / (rho A L^4) of wave numbers k L [rad^2/s^2]."""
    area, _, _, second_z = beam.section.figures
    stiff = beam.young * (second_z if second is None else second)
    return numbers**4 * stiff / (beam.density * area * beam.length**4)


def bending_roots(equation: Callable[[float], float], count: int) -> np.ndarray:
    """The lowest positive roots of a beam's frequency equation."""
    grid = np.linspace(0.05, np.pi * (count + 2), 4000)
    values = np.array([equation(x) for x in grid])
    crossings = np.flatnonzero(values[:-1] * values[1:] < 0)[:count]
    return np.array([brentq(equation, grid[k], grid[k + 1], xtol=1e-14) for k in crossings])


def cantilever(ratio: float = 0.0) -> Callable[[float], float]:
    """Frequency equation of a cantilever with `ratio` times its own mass as a point at its tip.

    1 + cos cosh + ratio x (cos sinh - sin cosh) = 0, divided by cosh so that it stays of order one
    (Blevins, Formulas for Natural Frequency and Mode Shape, table 8-8).
    """

    def equation(x: float) -> float:
        return 1 / np.cosh(x) + np.cos(x) + ratio * x * (np.cos(x) * np.tanh(x) - np.sin(x))

    return equation


def free_free(x: float) -> float:
    """Frequency equation cos cosh = 1 of a beam that is held nowhere, divided by cosh."""
    return np.cos(x) - 1 / np.cosh(x)
