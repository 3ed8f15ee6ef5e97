"""Interpretation of a column's name: quantity, joint, unit, and whether it was measured or commanded."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from missing_physics.recordings import unit_conversion

__all__ = ["Reading", "is_commanded", "is_time", "read_name", "tokens", "unit_of_time"]


def _words(text: str) -> frozenset[str]:
    return frozenset(text.split())


#: Words for quantities of a joint.
_QUANTITIES = {
    "position": _words(
        "q pos position positions angle angles ang theta enc encoder phi displacement displacements qpos"
    ),
    "velocity": _words("dq vel velocity velocities speed omega qdot dtheta rate qvel"),
    "acceleration": _words("ddq qdd acc acceleration qddot"),
    "torque": _words("tau torque torques trq effort efforts force moment"),
    "current": _words("i iq current currents cur curr amps"),
    "voltage": _words("volt voltage volts"),
    "temperature": _words("temp temperature temperatures"),
}
_QUANTITY = {word: quantity for quantity, words in _QUANTITIES.items() for word in words}
#: Words that mean a quantity in some logs and something else in others, so that the user is asked.
_AMBIGUOUS = {
    **dict.fromkeys(_words("th alpha beta gamma psi state action qm"), "position"),
    "qd": "velocity",
    "u": "voltage",
}
_COMMANDED = _words(
    "ref reference con cmd cmptd command commanded des desired target goal set setpoint action demand"
)
_MEASURED = _words("meas measured act actual sensor rec recorded raw cur current iq")
_COMPUTED = _words("est estimated model filt filtered sim pred predicted ff abs")
_MOTOR = _words("mot motor rotor")
_TIME = _words("t time times timestamp timestamps stamp stamps clock")
#: Words of columns that are not channels: a setting, a state of the drive, a difference of two channels.
_NO_CHANNEL = _words(
    "enable enabled limit lim max min error err diff status mode flag id gain kp kd ki supply input bus"
)

#: Units as written in column names, in lower case, and their names in pint.
_UNITS = {
    **dict.fromkeys(_words("deg degree degrees"), "deg"),
    **dict.fromkeys(_words("rad radian radians"), "rad"),
    **dict.fromkeys(_words("rev revs turn turns"), "rev"),
    **dict.fromkeys(_words("c degc celsius"), "degC"),
    **dict.fromkeys(_words("a amp amps"), "A"),
    **dict.fromkeys(_words("v volt volts"), "V"),
    **dict.fromkeys(_words("lb lbf"), "lbf"),
    **{
        "dps": "deg/s",
        "degs": "deg/s",
        "rads": "rad/s",
        "rps": "rev/s",
        "in": "inch",
        "ma": "mA",
        "mv": "mV",
    },
    **{"nm": "Nm", "mnm": "mNm", "ncm": "Ncm", "n": "N", "kn": "kN", "k": "K"},
    **{word: word for word in ("rpm", "m", "mm", "cm", "kip")},
}
#: Units that determine the quantity; single letters are excluded, since they may be names.
_QUANTITY_UNITS = _words("deg degree degrees rad radian radians rpm dps degs rads rps nm mnm ncm")
_TIMES = {
    **dict.fromkeys(_words("s sec secs seconds"), "s"),
    **dict.fromkeys(_words("ms msec millis milliseconds"), "ms"),
    **dict.fromkeys(_words("us usec micros microseconds"), "us"),
    **dict.fromkeys(_words("ns nsec nanos nanoseconds"), "ns"),
    "min": "min",
}
_SECONDS = _words("s sec second")
_BRACKETS = re.compile(r"[\[(]([^\])]+)[\])]\s*$")
_WORDS = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+|°")


@dataclass(frozen=True)
class Reading:
    """Interpretation of a name.

    Attributes:
        quantity: native name of the quantity.
        word: the word that names it.
        sure: whether the word is unambiguous.
        unit: as written in maps; empty if the name contains none.
        numbers: numbers in the name, in their order.
        rank: preference among columns of one channel: measured, unspecified, computed.
    """

    quantity: str
    word: str
    sure: bool
    unit: str
    numbers: tuple[int, ...]
    rank: int


def tokens(name: str) -> list[str]:
    """Words and numbers of a name in lower case: ``ActPos_1`` is act, pos, 1."""
    return [word.lower() for word in _WORDS.findall(_BRACKETS.sub("", name))]


def read_name(name: str) -> Reading | None:
    """Interpretation of a column's name; None if it has no word for a quantity."""
    words = tokens(name)
    places = [k for k, word in enumerate(words) if word in _QUANTITY or word in _AMBIGUOUS]
    if _NO_CHANNEL & set(words):
        return None
    if not places:
        return _by_unit(name, words)
    at = min(places, key=lambda k: (words[k] not in _QUANTITY, len(words[k]) == 1, k))
    base = _QUANTITY.get(words[at]) or _AMBIGUOUS[words[at]]
    others = {*words[:at], *words[at + 1 :]}
    quantity = base
    if (others | {words[at]}) & _COMMANDED and base in ("position", "velocity"):
        quantity = f"reference_{base}"
    elif others & _MOTOR and base in ("position", "velocity"):
        quantity = f"motor_{base}"
    rank = 2 * bool(others & _MEASURED) - bool(others & _COMPUTED) - 2 * bool(others & _COMMANDED)
    return Reading(
        quantity=quantity,
        word=words[at],
        sure=words[at] in _QUANTITY,
        unit=_unit(name, words[at + 1 :], quantity),
        numbers=tuple(int(word) for word in words if word.isdigit() and len(word) < 4),
        rank=rank,
    )


def _by_unit(name: str, words: Sequence[str]) -> Reading | None:
    """Interpretation of a name from its unit alone, as in ``shoulder_deg`` or ``elbow [Nm]``."""
    tail = [word for word in words if word in _QUANTITY_UNITS or word in _SECONDS]
    if not (tail and tail[0] in _QUANTITY_UNITS) and not _BRACKETS.search(name):
        return None
    for quantity in ("position", "velocity", "torque"):
        if unit := _unit(name, tail, quantity):
            numbers = tuple(int(word) for word in words if word.isdigit() and len(word) < 4)
            rank = 2 * bool(set(words) & _MEASURED) - 2 * bool(set(words) & _COMMANDED)
            return Reading(quantity, unit, False, unit, numbers, rank)
    return None


def is_commanded(name: str) -> bool:
    """Whether the name states that the quantity is commanded by a controller."""
    words = set(tokens(name))
    return bool(words & _COMMANDED) and not words & _MEASURED


def is_time(name: str) -> bool:
    """Whether the last part of the name is a word for time."""
    return bool(_TIME & set(tokens(name.split(".")[-1])))


def unit_of_time(name: str) -> str:
    """The unit of time at the end of the name; empty if there is none."""
    found = _BRACKETS.search(name)
    words = [found[1].strip().lower()] if found else tokens(name)[1:]
    return next((_TIMES[word] for word in reversed(words) if word in _TIMES), "")


def _unit(name: str, words: Sequence[str], quantity: str) -> str:
    """The unit in brackets, or in the words after that of the quantity; empty if none fits."""
    found = _BRACKETS.search(name)
    if found:
        text = found[1].strip()
        return next((unit for unit in (text, _UNITS.get(text.lower(), "")) if _fits(unit, quantity)), "")
    letters = [word for word in words if not word.isdigit() and word != "per"]
    for k, word in enumerate(letters):
        unit = _UNITS.get(word, "")
        if unit and letters[k + 1 : k + 2] and letters[k + 1] in _SECONDS:
            unit = f"{unit}/s"
        if _fits(unit, quantity):
            return unit
    return ""


def _fits(unit: str, quantity: str) -> bool:
    try:
        unit_conversion(unit, f"joint.{quantity}")
    except ValueError:
        return False
    return True
