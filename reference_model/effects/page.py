"""The catalogue page, generated from the effect classes.

``python -m reference_model.effects.page [PATH]`` writes it to PATH, default `docs/effects.md`.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from pathlib import Path

import reference_model.effects as package
from reference_model.effects.base import Effect, Parameter
from reference_model.effects.catalogue import catalogue
from robot_model import write_atomically

__all__ = ["PICTURES", "PLACES", "catalogue_page", "facts", "picture_of", "range_of"]

#: How each effect shows in a simulation: ID.svg.
PICTURES = Path(__file__).parent / "pictures"
#: The same from the folder of the catalogue page.
FROM_PAGE = "../reference_model/effects/pictures"

#: Where an effect can sit, in the order of the page, and what that means in a robot file.
PLACES = {
    "joint": "of a joint, or of a motor of a transmission; `at` is its name",
    "actuator": "of a joint's actuator, or of a motor of a transmission; `at` is the joint's or motor's name",
    "link": "of a link; `at` is the link's name, for `payload` and `inertia` also `base`",
    "base": "of the base and its surroundings; `at` is `base`",
    "sensor": "of a sensor; `at` is a channel, such as `joint1.position`",
}

#: Of effects that have no regressors along a recorded joint motion.
IN_GYROS = "searched for in the gyros of a free base"
WITHOUT_GYROS = ", and where there is none in the torques"

_HEAD = """# Effects

The physics that a robot simulation may lack. Generated from the effect classes
by `python -m reference_model.effects.page`; do not edit it by hand.

A robot file lists an effect as

```toml
[[effects]]
effect = "coulomb_friction"
at = "joint1"
torque = 4.0
```

Units are those of a revolute joint. For a prismatic joint read N for N m and m for rad. `channel` stands for
the unit of the channel of a sensor effect. `q`, `qd` are position and velocity of the joint, T is the force
added to it, and sgn is smoothed over the speed that counts as standstill. "Estimated" states whether a
diagnosis fits the parameter; the others stay at their default unless a robot file sets them.
Pictures are of simulations of small robots without and with the effect, by
`python -m benchmarks.signatures.pictures`; robots and values are in `benchmarks/signatures/cases.py`.
`missing-physics effects ID` shows the same of one effect in the terminal, `--out FILE.html` as a page.
"""


def catalogue_page() -> str:
    """The complete page as Markdown."""
    return "\n".join([_HEAD, *_contents(), *(line for p in PLACES for line in _place(p))]).rstrip() + "\n"


def range_of(parameter: Parameter) -> str:
    """`lower to upper`, rounded."""
    return f"{parameter.lower:g} to {parameter.upper:g}"


def _at(place: str) -> list[Effect]:
    return [effect for effect in catalogue().values() if effect.place == place]


def _contents() -> Iterator[str]:
    yield "| place | effects |"
    yield "|---|---|"
    for place in PLACES:
        names = ", ".join(f"[`{effect.id}`](#{effect.id})" for effect in _at(place))
        yield f"| {place} | {names} |"
    yield ""


def _place(place: str) -> Iterator[str]:
    if not _at(place):
        return
    yield f"## Effects {PLACES[place]}"
    yield ""
    for effect in _at(place):
        yield from _section(effect)


def picture_of(effect: Effect) -> Path | None:
    """The SVG file of an effect of this package, which all have one; None for any other effect."""
    ours = type(effect).__module__.startswith(f"{package.__name__}.")
    return PICTURES / f"{effect.id}.svg" if ours else None


def facts(effect: Effect) -> Mapping[str, str]:
    """Facts about an effect besides equation and parameters, heading to text; none is empty."""
    entries = {
        "shows as": effect.signature,
        "confused with": ", ".join(effect.confused_with) or "nothing known",
        "to tell apart": effect.experiment,
        "in a diagnosis": _in_a_diagnosis(effect),
        "needs": ", ".join(effect.needs),
        "comes on top of": " or ".join(effect.builds_on),
        "source": effect.source,
    }
    return {heading: text for heading, text in entries.items() if text}


def _in_a_diagnosis(effect: Effect) -> str:
    """Where a diagnosis searches for it, if not in torques along a motion; else empty."""
    if effect.turns_base:
        return IN_GYROS + (WITHOUT_GYROS if effect.is_searched else "")
    return ""


def _section(effect: Effect) -> Iterator[str]:
    yield f'### <a id="{effect.id}"></a>`{effect.id}`: {effect.title}'
    yield ""
    yield f"    {effect.equation}"
    yield ""
    yield from _parameters(effect)
    if picture_of(effect) is not None:
        yield f"![{effect.title}: how it shows in a simulation]({FROM_PAGE}/{effect.id}.svg)"
        yield ""
    yield f"- Shows as: {effect.signature}."
    yield f"- Confused with: {', '.join(f'`{name}`' for name in effect.confused_with) or 'nothing known'}."
    yield f"- To tell apart: {effect.experiment}."
    if searched := _in_a_diagnosis(effect):
        yield f"- In a diagnosis: {searched}."
    if effect.needs:
        yield f"- Needs in the recording: {', '.join(effect.needs)}."
    if effect.family:
        yield f"- Rung {effect.rung} of the ladder `{effect.family}`; one of them at a joint."
    if effect.builds_on:
        yield f"- Comes on top of one of: {', '.join(f'`{name}`' for name in effect.builds_on)}."
    yield f"- Source: {effect.source}."
    yield ""


def _parameters(effect: Effect) -> Iterator[str]:
    yield "| parameter | unit | meaning | range | no influence at | default | estimated |"
    yield "|---|---|---|---|---|---|---|"
    for p in effect.parameters:
        absent = "" if p.absent is None else f"{p.absent:g}"
        default = "" if p.default is None else f"{p.default:g}"
        yield (
            f"| `{p.name}` | {p.unit} | {p.meaning} | {range_of(p)} | {absent} | {default} "
            f"| {'yes' if p.estimated else 'no'} |"
        )
    yield ""


if __name__ == "__main__":
    write_atomically(sys.argv[1] if len(sys.argv) > 1 else "docs/effects.md", catalogue_page())
