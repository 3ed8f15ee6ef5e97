"""Unnamed forces, with their measured curves."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from missing_physics.hypotheses import Term
from missing_physics.inference import Fit
from missing_physics.inference.fit import fitted
from missing_physics.inference.torques.data import TorqueData
from missing_physics.results.result import Curve, Unnamed, in_words
from missing_physics.unnamed import UnknownForce

__all__ = ["unnamed"]

Array = NDArray[np.float64]

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
    values, own = term.parameters, [p.name for p in effect.estimated]
    names = [*(f"{effect.id}@{term.at}.{name}" for name in own), *(f"{term.at}.{n}" for n in effect.within)]
    knots = effect.knots(values)
    shape = np.hstack([effect.shape(values), effect.shape_within(values)])
    sizes = np.array(
        [*(values[name] for name in own), *(_beyond_file(data, fit, n) for n in names[len(own) :])]
    )
    torque = -shape @ sizes  # the actuator balances the force
    half = QUANTILE * np.sqrt(np.einsum("kp,pq,kq->k", shape, _covariance(fit, names), shape))
    pairs = tuple((float(v - h), float(v + h)) for v, h in zip(torque, half))
    curve = Curve(effect.carrier, tuple(map(float, torque)), pairs)
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
            f"fitted; {effect.phrase(in_words(variable))} predicts {removed} of their energy, more than any "
            "effect of the catalogue does."
        ),
    )


def _beyond_file(data: TorqueData, fit: Fit, name: str) -> float:
    """A parameter of the standard model minus its value in the robot file."""
    return fit.parameter(name) - float(data.file_values[fit.layout.names.index(name)])


def _covariance(fit: Fit, names: Sequence[str]) -> Array:
    """Covariance of parameters: their deviations, with the correlations of the objective, shape (P, P)."""
    places = [fit.layout.names.index(name) for name in names]
    free = fit.layout.free[places]
    at = (np.cumsum(fit.layout.free) - 1)[places][free]
    size = 1.0 / np.sqrt(np.maximum(np.diag(fit.hessian), np.finfo(float).tiny))
    inverse = np.linalg.pinv(fit.hessian * np.outer(size, size), hermitian=True)[np.ix_(at, at)]
    scale = np.zeros(len(names))
    scale[free] = fit.deviations[places][free] / np.sqrt(np.maximum(np.diag(inverse), np.finfo(float).tiny))
    found = np.zeros((len(names), len(names)))
    found[np.ix_(free, free)] = inverse
    return np.asarray(found * np.outer(scale, scale))


def _share(data: TorqueData, fit: Fit, term: Term) -> tuple[float, float]:
    """rms of the held-out error without the force [N m or N], and the fraction of its energy removed."""
    without = fitted(data, fit.hypothesis.less(term), fit)
    k, held_out = data.joints.index(term.at), ~data.fitted_blocks
    count = max(float(data.counts[held_out, k].sum()), 1.0)
    before, after = (float(one.errors[held_out, k].sum()) for one in (without, fit))
    return float(np.sqrt(before / count)), 1.0 - after / max(before, 1e-300)
