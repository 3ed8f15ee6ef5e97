"""Prior knowledge of an effect's parameters: credible ranges, as priors and as limits."""

from __future__ import annotations

import casadi as ca
import numpy as np

from missing_physics.bodies.pseudo_inertia import COUNT, pseudo_inertia
from missing_physics.hypotheses.term import Term
from missing_physics.plausibility import credible_range, implausible
from reference_model.dynamics.inertial import inertial_names, nominal_inertial
from reference_model.effects.base import BodyEffect, Parameter
from reference_model.effects.catalogue import get_effect
from reference_model.effects.gear_spring import SLOWEST_TWIST
from robot_model import Robot

__all__ = ["not_credible", "prior_of"]

#: A credible range extends two standard deviations to either side.
WIDTH = 0.5


def prior_of(term: Term, parameter: Parameter) -> tuple[float, float] | None:
    """Prior mean and standard deviation of a parameter; None if only the recordings determine its value."""
    if parameter.name in term.effect.priors:
        return term.effect.priors[parameter.name]
    known = credible_range(term.effect.id, parameter.name, term.at)
    if known is not None:
        return 0.0, WIDTH * max(-known.low, known.high)
    # Behind the only encoder, damping is confounded with a delay of the torque.
    if parameter.name == "damping" and "stiffness" in term.parameters and term.along:
        return 0.0, WIDTH * SLOWEST_TWIST * term.parameters["stiffness"]
    return None


def not_credible(term: Term, robot: Robot, needed: float) -> str:
    """Why a fitted term is not credible, as a clause; empty if it is.

    Args:
        term: with fitted parameters.
        robot: nominal.
        needed: largest torque that the recorded motion needs at its joint [N m or N].
    """
    if term.is_given and not term.freed:
        return ""
    effect, values = term.effect, term.parameters
    meaning = [p for p in term.free if p.absent is not None]
    complete = {p.name for p in meaning}.issuperset(effect.essential)
    if meaning and complete and all(values[p.name] == p.absent for p in meaning):
        return "its numbers are those of no effect at all"
    for simpler, names in effect.contains.items():
        essential = [p for p in meaning if p.name not in names.values()]
        if essential and all(values[p.name] == p.absent for p in essential):
            return f"it is no more than {get_effect(simpler).title.lower()}"
    if isinstance(effect, BodyEffect) and not _is_real(effect, term, robot):
        return "no real body has such mass properties"
    return effect.implausible(values) or implausible(effect.id, term.at, values, robot, needed=needed)


def _is_real(effect: BodyEffect, term: Term, robot: Robot) -> bool:
    """Whether the mass properties of the link with the term are physically consistent."""
    names = inertial_names(robot)
    if f"{term.at}.mass" not in names:
        return True
    first = names.index(f"{term.at}.mass")
    link = nominal_inertial(robot)[first : first + COUNT]
    added = effect.terms({name: ca.SX(value) for name, value in term.parameters.items()})
    pairs = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
    parts = [added.mass, *ca.vertsplit(added.first_moment), *(added.inertia[pair] for pair in pairs)]
    total = link + np.array([float(ca.DM(part)) for part in parts])
    return float(np.linalg.eigvalsh(pseudo_inertia(total))[0]) > -1e-9 * abs(float(total[0]))
