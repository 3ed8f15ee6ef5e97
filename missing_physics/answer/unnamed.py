"""Unnamed forces, with their measured curves."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from missing_physics.hypotheses import Term, UnknownForce
from missing_physics.inference import Data, Fit, Posterior
from missing_physics.results.result import Curve, Unnamed, in_words

__all__ = ["unnamed"]

#: Quantile of the 95 % interval.
QUANTILE = 1.96


def unnamed(data: Data, known: Posterior, fit: Fit) -> Iterator[Unnamed]:
    """Forces of the answer that no effect of the catalogue explains equally well."""
    for term in fit.hypothesis.terms:
        if isinstance(term.effect, UnknownForce):
            yield _unnamed(data, known, fit, term, term.effect)


def _unnamed(data: Data, known: Posterior, fit: Fit, term: Term, effect: UnknownForce) -> Unnamed:
    joint = next(j for j in data.standard.nominal.drives if j.name == term.at)
    unit = "N" if joint.kind == "prismatic" else "N m"
    variable = f"{term.at}.{effect.variable}"
    knots, shape = effect.knots(term.parameters), effect.shape(term.parameters)
    sizes = np.array([term.parameters[p.name] for p in effect.estimated])
    spread = np.array([fit.deviation(f"{effect.id}@{term.at}.{p.name}") for p in effect.estimated])
    values = -shape @ sizes  # the actuator balances the force
    half = QUANTILE * np.abs(shape) @ spread  # upper bound: all errors fully correlated
    pairs = tuple((float(v - h), float(v + h)) for v, h in zip(values, half))
    curve = Curve(effect.carrier, tuple(map(float, values)), pairs)
    left, share = _share(data, known, fit, term)
    times = " times the direction of motion" if effect.carrier else ""
    return Unnamed(
        location=term.at,
        channel=f"{term.at}.torque",
        unit=unit,
        depends_on=(variable,),
        law="",
        share=share,
        left=left,
        knots=(tuple(map(float, knots)),),
        curves=(curve,),
        words=(
            f"{term.at}.torque: after the named effects, {left:.3g} {unit} rms remain in data that were not "
            f"fitted; a curve over {in_words(variable)}{times} predicts {share:.0%} of their energy, more "
            "than any effect of the catalogue does."
        ),
    )


def _share(data: Data, known: Posterior, fit: Fit, term: Term) -> tuple[float, float]:
    """rms of the held-out error without the force [N m or N], and the part of its energy it removes."""
    keys = {one.key for one in fit.hypothesis.terms} - {term.key}
    others = [one for one in known.fits if {t.key for t in one.hypothesis.terms} == keys]
    k, unseen = data.joints.index(term.at), ~data.seen
    count = max(float(data.counts[unseen, k].sum()), 1.0)
    after = float(fit.errors[unseen, k].sum())
    before = float(others[0].errors[unseen, k].sum()) if others else after
    return float(np.sqrt(before / count)), max(1.0 - after / max(before, 1e-300), 0.0)
