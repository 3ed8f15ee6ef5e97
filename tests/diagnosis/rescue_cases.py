"""What tests of runs that save and complete names have in common."""

from __future__ import annotations

from missing_physics.diagnosis.terms import Term
from reference_model.effects.catalogue import get_effect
from robot_model import EffectUse

SPRING = EffectUse(effect="cable_spring", at="joint1", stiffness=600.0, torque_at_zero=0.0)


def term_of(use: EffectUse, factor: float = 1.0) -> Term:
    return Term(get_effect(use.effect), use.at, {k: factor * v for k, v in use.parameters.items()})
