"""Whether what was named accounts for what differs where it acts.

Evidence compares explanations with each other, held-out data with none: physics that is in no catalogue can
make both speak for whatever is nearest to it. It shows in what is left. Where the right effects are in the
model, noise is left. Where much more is left, a name is worth what it removes beside that; one that leaves
more than it removes is no name.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from missing_physics.diagnosis.explanation import Explanation, explain
from missing_physics.diagnosis.result import Finding, Fit
from missing_physics.diagnosis.terms import Term
from reference_model.effects.catalogue import get_effect

__all__ = ["Account", "account_of", "believed", "without_inadequate"]

#: What noise leaves, over its floor: floors are estimates, and what is fitted has errors of its own.
NOISE = 1.5
#: A name is half believed where it removes so many times the energy that is left beyond noise. Calibrated on
#: development cases: friction that grows at rest, called Stribeck friction, removes 50 times what it leaves;
#: Coulomb friction of a real ball screw, whose other physics nobody knows, 500 times.
HALF_BELIEVED = 10.0


@dataclass(frozen=True)
class Account:
    """Energies on held-out data, in units of the noise floor's.

    Attributes:
        removed: by which the mismatch beyond noise has fallen.
        left: of it, beyond noise.
    """

    removed: float
    left: float

    @property
    def belief(self) -> float:
        """How far a name is believed that stands for what was removed, 0 to 1."""
        return self.removed / (self.removed + HALF_BELIEVED * self.left) if self.left > 0 else 1.0

    @property
    def adequate(self) -> bool:
        """Whether more was removed than is left."""
        return self.removed >= self.left


def account_of(fit: Fit, location: str) -> Account:
    """The account of the joint or the gyro of a location, or of all joints for a body or the base."""
    own = (location, f"{location.split('.')[0]}.torque")
    channels = [fit.channels[name] for name in own if name in fit.channels][:1] or [
        c for name, c in fit.channels.items() if name.endswith(".torque")
    ]
    removed = left = 0.0
    for channel in channels:
        floor = max(channel.noise_floor, np.finfo(float).tiny)
        before, after = (
            max((errors.validation_rms / floor) ** 2 - NOISE**2, 0.0)
            for errors in (channel.before, channel.after)
        )
        removed += max(before - after, 0.0)
        left += after
    return Account(removed, left)


def without_inadequate(
    best: Explanation, fit: Fit, kept: Collection[tuple[str, str]], *, nuisance: bool
) -> tuple[Explanation, tuple[tuple[Term, str], ...]]:
    """`best` without terms at joints where more is left than was removed; those terms, and why.

    Events stay, as no other data can show what they remove; so do the terms whose keys are in `kept`.
    """
    dropped = [
        (term, _words(fit, term.at))
        for term in best.found
        if not term.effect.is_event and term.key not in kept and not account_of(fit, term.at).adequate
    ]
    if not dropped:
        return best, ()
    gone = {term.key for term, _ in dropped}
    rest = [term for term in best.terms if term.key not in gone]
    return explain(best.problem, best.view, rest, nuisance=nuisance), tuple(dropped)


def _words(fit: Fit, location: str) -> str:
    own = (location, f"{location.split('.')[0]}.torque")
    found = next((fit.channels[name] for name in own if name in fit.channels), None)
    if found is None:
        return "it leaves more than it removes, far beyond noise"
    return (
        f"it leaves {found.after.validation_rms:.3g} of {found.before.validation_rms:.3g} {found.unit} rms, "
        f"against {found.noise_floor:.3g} {found.unit} of noise: something else is there"
    )


def believed(findings: Sequence[Finding], fit: Fit) -> tuple[Finding, ...]:
    """Findings as probable as what is left where they act allows."""
    return tuple(_believed(finding, fit) for finding in findings)


def _believed(finding: Finding, fit: Fit) -> Finding:
    if get_effect(finding.effect).is_event:
        return finding
    belief = account_of(fit, finding.location).belief
    return replace(
        finding,
        probability=finding.probability * belief,
        alternatives=tuple(replace(a, probability=a.probability * belief) for a in finding.alternatives),
    )
