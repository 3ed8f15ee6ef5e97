"""Units that a map names, such as ``deg``, ``rpm`` or ``mNm``: factor and shift to a channel's SI unit."""

from __future__ import annotations

import re
from functools import cache
from typing import TYPE_CHECKING, Any

from missing_physics.recordings.channels.names import place_of
from robot_model import unit_of

if TYPE_CHECKING:
    import pint

__all__ = ["Conversion", "conversion", "seconds"]

#: Factor and shift: ``SI = factor * value + shift``.
Conversion = tuple[float, float]

#: Products and quotients of units with small powers; other expressions of pint, such as powers of powers, are
#: not used in recordings.
_NAME = r"(?:[^\W\d_][^\W\d]*|°C|°|%)(?:(?:\*\*|\^)?-?[1-9]|[²³])?"
_UNIT = re.compile(rf"(?:1|{_NAME})(?:(?: ?[*/·] ?| ){_NAME})*")
_LONGEST = 40
#: Quantities of joints that may be meant by a wrong unit.
_OTHERS = ("position", "velocity", "acceleration", "torque", "current", "voltage", "temperature")


def conversion(unit: str, channel: str, *, slides: bool = False, derivative: bool = False) -> Conversion:
    """Factor and shift from `unit` to the SI unit of a channel.

    Args:
        unit: of the variable in the file.
        channel: native name.
        slides: whether the joint is known to slide, so that angles are excluded.
        derivative: the variable's time derivative is taken.

    Raises:
        ValueError: no such unit, or one of another quantity; with a message.
    """
    kinds = (True,) if slides else (False, True)
    expected = dict.fromkeys(unit_of(channel, prismatic=kind) for kind in kinds)
    found = _parsed(unit)
    for own in expected:
        fits = _fitting(found, _root(own, derivative))
        if fits is not None:
            return fits
    units = " or ".join(expected)
    raise ValueError(f"'{unit}' is no unit of {channel}, which is in {units}{_meant(found, channel)}")


def seconds(unit: str) -> float:
    """Seconds per unit of time. Raises ValueError, in words, where it is none."""
    fits = _fitting(_parsed(unit), _root("s"))
    if fits is None:
        raise ValueError(f"'{unit}' is no unit of time; give one such as s, ms or us")
    return fits[0]


@cache
def _registry() -> pint.UnitRegistry[float]:
    """Pint's units, and names that logs have."""
    import pint  # it takes a third of a second

    registry: pint.UnitRegistry[float] = pint.UnitRegistry(on_redefinition="ignore", cache_folder=None)
    registry.define("newton_meter = newton * meter = Nm")
    registry.define("newton_centimeter = 0.01 * newton * meter = Ncm")
    registry.define("revolution = 2 * pi * radian = _ = turn = rev")
    return registry


def _parsed(unit: str) -> pint.Unit:
    import pint

    text = unit.strip()
    if len(text) <= _LONGEST and _UNIT.fullmatch(text):
        try:
            return _registry().parse_units(text.replace("·", "*"))
        except (pint.errors.PintError, ValueError, TypeError, AttributeError, ZeroDivisionError):
            pass
    raise ValueError(f"'{unit}' is no unit; write one such as deg, rpm, ms, A, Nm, mm/s or degC")


def _root(unit: str, derivative: bool = False) -> Any:
    """Base units of one of our units, without factor; None if pint has none, as for sqrt(kg) m.

    Angles are preserved: radians are base units in pint, but not dimensions.
    """
    if not _UNIT.fullmatch(unit) and unit != "-":
        return None
    registry = _registry()
    own = registry.parse_units("" if unit == "-" else unit)
    return registry.Quantity(1.0, own * registry.second if derivative else own).to_base_units().units


def _fitting(found: pint.Unit, root: Any) -> Conversion | None:
    """Factor and shift to base units, if `found` has these."""
    registry = _registry()
    one = registry.Quantity(1.0, found).to_base_units()
    if root is None or one.units != root:
        return None
    shift = float(registry.Quantity(0.0, found).to_base_units().magnitude)
    return float(one.magnitude) - shift, shift


def _meant(found: pint.Unit, channel: str) -> str:
    """The channel of the same joint that has such a unit, as the end of a sentence."""
    for quantity in _OTHERS:
        other = f"{place_of(channel)}.{quantity}"
        if other != channel and _fitting(found, _root(unit_of(other))) is not None:
            return f"; {other} would have it"
    return ""
