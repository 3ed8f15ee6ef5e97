"""The augmented robot file: the nominal robot with re-estimated parameters and the effects found."""

from __future__ import annotations

from collections.abc import Mapping

from missing_physics.hypotheses import Term
from missing_physics.inference import Fit
from missing_physics.inference.torques.data import TorqueData
from missing_physics.standard.model import as_robot, use_of
from missing_physics.standard.rows import without_friction
from reference_model.effects.catalogue import get_effect
from robot_model import EffectUse, Robot

__all__ = ["augmented"]


def augmented(data: TorqueData, fit: Fit, more: Mapping[tuple[str, str], Mapping[str, float]]) -> Robot:
    """The nominal robot with the parameters and effects of a fit.

    Args:
        data: the rows.
        fit: the answer.
        more: further effects by effect and place, which are parameters of the fit, such as delays.
    """
    parameters = dict(zip(fit.layout.names, map(float, fit.parameters)))
    robot = as_robot(without_friction(data.standard.nominal), data.runs[0].model, parameters)
    kept = tuple(
        use for use in robot.effects if not get_effect(use.effect).standard or any(_values(use).values())
    )
    found = [
        use_of(term.effect.id, term.at, term.parameters)
        for term in fit.hypothesis.terms
        if not _is_left_out(term, data)
    ]
    found += [use_of(effect, at, values) for (effect, at), values in more.items()]
    taken = {(use.effect, use.at) for use in found}
    kept = tuple(use for use in kept if (use.effect, use.at) not in taken)
    return robot.model_copy(update={"effects": (*kept, *found)})


def _is_left_out(term: Term, data: TorqueData) -> bool:
    """Whether a term is unnamed, or present in only one of several recordings.

    In a robot file it would apply to all of them.
    """
    return term.effect.is_unknown or (term.run is not None and len(data.runs) > 1)


def _values(use: EffectUse) -> dict[str, float]:
    return {k: v for k, v in use.model_dump().items() if k not in ("effect", "at")}
