"""The robot file's own numbers in runs: masses, inertias and friction that are off, or tuned to hide a gap.

Where they were tuned to a recording without what is missing, it alone brings no run down to the noise: the
numbers have to come back with it. They are its friction laws' and those combinations of its inertial numbers
that the recordings tell (`InertialBasis`), which a run knows as well as any sensor tells.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.least_squares.explanation import Explanation, explain
from missing_physics.diagnosis.least_squares.view import Told, View
from missing_physics.diagnosis.preparation.setup import InertialBasis
from missing_physics.diagnosis.terms.term import Term
from reference_model.effects.base import Effect, Parameter

__all__ = ["MOST", "Combinations", "freed", "moved_view", "own_numbers"]

Array = NDArray[np.float64]
#: A combination is usually off by this part of the typical size of its numbers, and by no more than all: so
#: uncertain is one that runs do not tell.
USUAL, MOST = 0.03, 1.0
#: To this part of it runs of bodies that are none go with real ones instead.
TRIED = 1e-4


class Combinations(Effect):
    """Changes of the inertial combinations, as runs fit them: no effect, and in no catalogue."""

    id = "inertial_combinations"
    title = "inertial numbers of the robot file"
    place = "base"
    parameters = ()

    def __init__(self, count: int) -> None:
        """`count` of them, as parts of their typical sizes."""
        words = "change of a combination of inertial numbers"
        self._numbers = tuple(
            Parameter(f"combination_{k + 1}", "1", words, -MOST, MOST, USUAL) for k in range(count)
        )

    @property
    def estimated(self) -> tuple[Parameter, ...]:
        """The combinations, in the order of `InertialBasis.first`."""
        return self._numbers


def own_numbers(explanation: Explanation, basis: InertialBasis, most: int) -> tuple[Term, ...]:
    """What of the robot file may be off, as terms with free numbers: combinations, and laws it lists.

    Args:
        basis: the combinations, the faint ones among them as far as there are no more than `most` numbers.
    """
    problem, told = explanation.problem, explanation.view.told
    laws = [
        replace(term.released, frozen=False)
        for term in explanation.terms
        if term.nominal and term.effect.along_motion
    ]
    room = most - sum(len(law.free) for law in laws)
    count = max(min(basis.most, room), problem.nuisance.shape[2])
    if not count:
        return tuple(laws)
    effect, values = Combinations(count), np.zeros(count)
    if told is not None:
        values[: told.values.size] = told.values[:count]
    numbers = dict(zip((p.name for p in effect.estimated), map(float, values)))
    return (Term(effect, "robot", numbers, nominal=True), *laws)


def moved_view(view: View, numbers: Mapping[tuple[str, str], Mapping[str, float]], covariance: Array) -> View:
    """`view` with the combinations that are among `numbers`, which are by terms' keys.

    Args:
        covariance: of the combinations, shape (B, B); empty while they are only tried.
    """
    found = next((own for (effect, _), own in numbers.items() if effect == Combinations.id), None)
    if found is None:
        return view
    known = covariance if covariance.size else TRIED**2 * np.eye(len(found))
    return replace(view, told=Told(np.array(list(found.values())), known))


def freed(explanation: Explanation, terms: Sequence[Term], covariance: Array) -> Explanation:
    """`explanation` with `terms` in the place of those of the same key, the combinations in its view."""
    numbers = {term.key: term.parameters for term in terms}
    own = {term.key: term for term in terms}
    view = moved_view(explanation.view, numbers, covariance)
    there = [own.get(term.key, term) for term in explanation.terms]
    return explain(explanation.problem, view, there, nuisance=explanation.nuisance.size > 0)
