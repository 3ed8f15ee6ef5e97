"""Unnamed forces, with their measured curves."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from missing_physics.hypotheses import Term, UnknownForce
from missing_physics.inference import Fit
from missing_physics.inference.fit import fitted
from missing_physics.inference.torques.data import TorqueData
from missing_physics.results.result import Curve, Unnamed, in_words

__all__ = ["unnamed"]

#: Quantile of the 95 % interval.
QUANTILE = 1.96


def unnamed(data: TorqueData, fit: Fit) -> Iterator[Unnamed]:
    """Unnamed forces of the answer that reduce held-out errors."""
    for term in fit.hypothesis.terms:
        if isinstance(term.effect, UnknownForce):
            left, share = _share(data, fit, term)
            if share > 0.0:
                yield _unnamed(data, fit, term, term.effect, left, share)


def _unnamed(
    data: TorqueData, fit: Fit, term: Term, effect: UnknownForce, left: float, share: float
) -> Unnamed:
    joint = next(j for j in data.standard.nominal.drives if j.name == term.at)
    unit = "N" if joint.kind == "prismatic" else "N m"
    variable = f"{term.at}.{effect.variable}" if effect.of_joint else effect.variable
    knots, shape = effect.knots(term.parameters), effect.shape()
    sizes = np.array([term.parameters[p.name] for p in effect.estimated])
    spread = np.array([fit.deviation(f"{effect.id}@{term.at}.{p.name}") for p in effect.estimated])
    values = -shape @ sizes  # the actuator balances the force
    half = QUANTILE * np.abs(shape) @ spread  # upper bound: all errors fully correlated
    pairs = tuple((float(v - h), float(v + h)) for v, h in zip(values, half))
    curve = Curve(effect.carrier, tuple(map(float, values)), pairs)
    times = " times the direction of motion" if effect.carrier else ""
    removed = f"{share:.0%}" if share >= 0.005 else "less than 1%"
    return Unnamed(
        location=term.at,
        channel=f"{term.at}.torque",
        unit=unit,
        depends_on=(variable,),
        share=share,
        left=left,
        knots=(tuple(map(float, knots)),),
        curves=(curve,),
        words=(
            f"{term.at}.torque: after the named effects, {left:.3g} {unit} rms remain in data that were not "
            f"fitted; a curve over {in_words(variable)}{times} predicts {removed} of their energy, more "
            "than any effect of the catalogue does."
        ),
    )


def _share(data: TorqueData, fit: Fit, term: Term) -> tuple[float, float]:
    """rms of the held-out error without the force [N m or N], and the fraction of its energy removed."""
    without = fitted(data, fit.hypothesis.less(term), fit)
    k, held_out = data.joints.index(term.at), ~data.fitted_blocks
    count = max(float(data.counts[held_out, k].sum()), 1.0)
    before, after = (float(one.errors[held_out, k].sum()) for one in (without, fit))
    return float(np.sqrt(before / count)), 1.0 - after / max(before, 1e-300)
