"""Numbers at the end of what they can be, which the data want beyond it.

A law that fits only with a number that it cannot have, such as a ripple whose period is longer than the
travel, stands in for another force. Sizes that the catalogue's range cuts off refuse a name at once
(`naming.cut_off`); a number of shape may lie at an end for a while, until what else is there has been named.
"""

from __future__ import annotations

import numpy as np

from missing_physics.diagnosis.least_squares.explanation import Explanation
from missing_physics.diagnosis.naming.search import ODDS
from missing_physics.diagnosis.terms.term import Term

__all__ = ["wants_beyond"]

#: A number this close to an end, as a part of its size, is there.
AT_THE_END = 1e-9


def wants_beyond(explanation: Explanation, term: Term) -> str:
    """Which number of `term` the data want beyond the end of its range; empty where there is none.

    The fit is linear about its end: it has to be beyond where letting the number go, with everything else
    fitted anew, moves it outwards and brings the evidence that a name must bring. Numbers whose end means
    that the effect is absent do not count, nor those of a family's laws: there the end is another law of the
    family, which has been weighed by itself.
    """
    if term.effect.family is not None:
        return ""
    start = explanation.slice_of(term).start
    for place, parameter in enumerate(term.estimated, start):
        value = term.parameters[parameter.name]
        for end, outwards in zip(
            term.narrowed.get(parameter.name, (parameter.lower, parameter.upper)), (-1, 1)
        ):
            if end == parameter.absent or abs(value - end) > AT_THE_END * max(abs(end), abs(value)):
                continue
            if _evidence(explanation, place, value, outwards) > np.log(ODDS):
                return (
                    f"its {parameter.name.replace('_', ' ')} has to be beyond {end:.3g}, where it cannot be"
                )
    return ""


def _evidence(explanation: Explanation, place: int, value: float, outwards: int) -> float:
    """For letting one number go that is held at `value`; nothing where it would go inwards."""
    free = explanation.regression
    if outwards * (free.solution()[place] - value) <= 0:
        return 0.0
    held = free.held(np.array([place]), np.array([value]))
    ratio = held.residual_energy() / max(free.residual_energy(), 1e-300)
    effective = float(explanation.effective.sum())
    return float(0.5 * effective * np.log(ratio) - 0.5 * np.log(max(effective, 2.0)))
