"""Beam parameters in which the equations of motion are linear, with fixed mode shapes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reference_model.flexible.attached import attached
from reference_model.flexible.body import FlexibleBody
from robot_model import Beam

__all__ = ["BEAM_NUMBERS", "POSITIVE", "BeamNumber", "beam_numbers", "beam_with"]

Array = NDArray[np.float64]

#: Mass of a beam [kg], its stiffness relative to the description [-], the mass at its tip [kg], and the
#: addition to the damping ratio of every mode [-].
BEAM_NUMBERS = ("beam_mass", "stiffness", "tip_mass", "damping_ratio")
#: Those of them that are positive.
POSITIVE = BEAM_NUMBERS[:3]
#: Constants of a flexible body in proportion to its mass.
HEAVY = (
    "mass",
    "first_moment",
    "inertia",
    "S0",
    "S1",
    "E",
    "F",
    "D",
    "P",
    "h",
    "modal_mass",
    "node_masses",
    "node_inertias",
)


@dataclass(frozen=True)
class BeamNumber:
    """One parameter of a beam.

    Attributes:
        name: one of `BEAM_NUMBERS`.
        value: in the description.
        change: of the body's constants per unit; shapes and frequencies are those of the body.
    """

    name: str
    value: float
    change: FlexibleBody


def beam_numbers(beam: Beam, body: FlexibleBody) -> tuple[BeamNumber, ...]:
    """The parameters of a beam.

    Args:
        beam: the description.
        body: its constants without the hub.
    """
    nothing, still = np.zeros(3), np.zeros((3, 3))
    bare = attached(body, body.tip, -beam.tip.mass, nothing, still)
    tip = attached(bare, body.tip, 1.0, nothing, still)
    bodies = {
        "beam_mass": _changed(body, {k: getattr(bare, k) / beam.mass for k in HEAVY}, stiff=False),
        "stiffness": _changed(body, {k: np.zeros_like(getattr(body, k)) for k in HEAVY}, stiff=True),
        "tip_mass": _changed(body, {k: getattr(tip, k) - getattr(bare, k) for k in HEAVY}, stiff=False),
        "damping_ratio": _damped(body),
    }
    values = {"beam_mass": beam.mass, "stiffness": 1.0, "tip_mass": beam.tip.mass, "damping_ratio": 0.0}
    return tuple(BeamNumber(name, values[name], bodies[name]) for name in BEAM_NUMBERS)


def _changed(body: FlexibleBody, heavy: dict[str, Any], *, stiff: bool) -> FlexibleBody:
    """Change of the constants: mass-proportional ones as given, elastic ones entirely or not at all.

    Damping ratios are constant, so that damping grows with the root of the stiffness.
    """
    part = 1.0 if stiff else 0.0
    elastic: dict[str, Any] = {"stiffness": part * body.stiffness, "damping": 0.5 * part * body.damping}
    return replace(body, **elastic, **heavy)


def _damped(body: FlexibleBody) -> FlexibleBody:
    """Change of the constants per unit increase of all damping ratios."""
    nothing: dict[str, Any] = {k: np.zeros_like(getattr(body, k)) for k in HEAVY}
    damping = np.diag(2.0 * body.frequencies)
    return replace(body, stiffness=np.zeros_like(body.stiffness), damping=damping, **nothing)


def beam_with(beam: Beam, numbers: dict[str, float]) -> dict[str, object]:
    """Values of a beam's keys in the robot file for these parameters, by `BEAM_NUMBERS`."""
    stiff = numbers["stiffness"]
    return {
        "density": beam.density * numbers["beam_mass"] / beam.mass,
        "young": beam.young * stiff,
        "shear": beam.shear * stiff,
        "tip": {**beam.tip.model_dump(), "mass": numbers["tip_mass"]},
    }
