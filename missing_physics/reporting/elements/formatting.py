"""Human-readable numbers and names; shared by the HTML report and the printed summary."""

from __future__ import annotations

import math
from collections.abc import Iterable

from missing_physics.results.result import Estimate, Finding
from missing_physics.wording.numbers import ABSENT, interval_text, number, within_text
from reference_model.effects.base import Effect
from reference_model.effects.catalogue import catalogue

__all__ = [
    "ABSENT",
    "effect_of",
    "effect_title",
    "estimate_text",
    "finding_text",
    "interval_text",
    "joined",
    "number",
    "p_value_text",
    "parameter_title",
    "percent",
    "plus_minus_text",
    "probability_text",
    "rival_text",
    "undetermined_text",
]

#: Smallest p-value that is written with digits.
TINY_P_VALUE = 1e-12


def percent(share: float | None) -> str:
    """A fraction in per cent: as an integer, or with one decimal below 10 %."""
    if share is None or not math.isfinite(share):
        return ABSENT
    if abs(share) < 0.0005:
        return "0 %"
    return f"{100 * share:.0f} %" if abs(share) >= 0.0995 else f"{100 * share:.1f} %"


def probability_text(probability: float) -> str:
    """A probability in per cent that never claims certainty."""
    if not math.isfinite(probability):
        return ABSENT
    if probability > 0.999:
        return "> 99.9 %"
    if probability < 0.001:
        return "< 0.1 %"
    return percent(probability) if probability < 0.995 else f"{100 * probability:.1f} %"


def p_value_text(p_value: float) -> str:
    """A p-value with two digits, or the bound below which it lies."""
    if math.isfinite(p_value) and p_value < TINY_P_VALUE:
        return f"< {TINY_P_VALUE:.0e}"
    return number(p_value, 2)


def estimate_text(estimate: Estimate) -> str:
    """``4.40 [4.10, 4.70] N m``."""
    return within_text(estimate.value, estimate.ci95, estimate.unit)


def plus_minus_text(estimate: Estimate) -> str:
    """``4.40 ± 0.30 N m`` if the interval is symmetric to a tenth of its width, else as an interval."""
    value, low, high = estimate.value, *estimate.ci95
    half = (high - low) / 2
    if not math.isfinite(half) or abs((high + low) / 2 - value) > 0.1 * half or half == 0.0:
        return estimate_text(estimate)
    shown = interval_text(value, (value - half, value + half))[0]
    spread = interval_text(half, (0.0, 2 * half))[0]
    return f"{shown} ± {spread} {_unit(estimate.unit)}".rstrip()


def effect_of(effect_id: str) -> Effect | None:
    """The catalogue's entry, or None for an effect that this installation does not know."""
    return catalogue().get(effect_id)


def effect_title(effect_id: str) -> str:
    """The effect's title."""
    effect = effect_of(effect_id)
    return effect.title if effect else effect_id.replace("_", " ")


def rival_text(label: str, place: str) -> str:
    """``Torque offset`` of a rival ``torque_offset@joint2`` to a finding at joint2, else with its place."""
    effect, _, where = label.partition("@")
    title = effect_title(effect)
    return title if where in ("", place) else f"{title} at {where}"


def parameter_title(effect_id: str, parameter: str) -> str:
    """Meaning of an effect's parameter, or its name in words."""
    effect = effect_of(effect_id)
    found = [p.meaning for p in effect.parameters if p.name == parameter] if effect else []
    return found[0] if found else parameter.replace("_", " ")


def joined(words: Iterable[str], last: str = "and") -> str:
    """``a, b and c``."""
    items = list(words)
    if len(items) < 2:
        return "".join(items)
    return f"{', '.join(items[:-1])} {last} {items[-1]}"


def finding_text(finding: Finding) -> str:
    """``Coulomb friction at joint2``."""
    return f"{effect_title(finding.effect)} at {finding.location}"


def undetermined_text(finding: Finding) -> str:
    """``These data do not determine: mass, inertia_yy.``; empty if they determine every parameter.

    A parameter whose posterior interval is as wide as the prior one is not determined, and is not reported.
    """
    undetermined = [name for name, estimate in finding.parameters.items() if not estimate.narrowed]
    return f"These data do not determine: {', '.join(undetermined)}." if undetermined else ""


def _unit(unit: str) -> str:
    return "" if unit in ("", "-", "1") else unit
