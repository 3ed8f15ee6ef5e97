"""Expressions in ``${...}``: arithmetic, text, lists and a list of functions; nothing else can be called."""

from __future__ import annotations

import ast
import math
import operator
from collections.abc import Callable, Mapping
from types import MappingProxyType, SimpleNamespace
from typing import Any

from simpleeval import BASIC_ALLOWED_ATTRS, DEFAULT_OPERATORS, EvalWithCompoundTypes

__all__ = ["CONSTANTS", "evaluate", "namespaces"]

#: Larger whole numbers do not describe a robot, and their powers fill the memory.
LARGEST_WHOLE = 2**64

#: Elements of a list; a robot has at most 256 bodies.
LONGEST_LIST = 10_000

MATHS = (
    *("acos", "asin", "atan", "atan2", "ceil", "copysign", "cos", "cosh", "degrees", "exp", "fabs", "floor"),
    *("fmod", "hypot", "isclose", "log", "log10", "log2", "pow", "radians", "sin", "sinh", "sqrt", "tan"),
    *("tanh", "trunc"),
)

CONSTANTS: Mapping[str, Any] = {
    **{name: getattr(math, name) for name in ("pi", "e", "tau", "inf")},
    "True": True,
    "False": False,
    "true": True,
    "false": False,
    "None": None,
}

#: Methods of text that do not lengthen it.
TEXT = {"lower", "upper", "strip", "lstrip", "rstrip", "split", "startswith", "endswith", "isdigit", "title"}


def _range(*bounds: int) -> list[int]:
    found = range(*bounds)
    if len(found) > LONGEST_LIST:
        raise ValueError(f"range() of more than {LONGEST_LIST} numbers")
    return list(found)


def _power(base: Any, exponent: Any) -> Any:
    """Powers of whole numbers stay whole only while they are small."""
    if isinstance(exponent, int) and 0 <= exponent <= 64 and abs(base) <= LARGEST_WHOLE:
        return base**exponent
    try:
        return float(base) ** float(exponent)
    except OverflowError:
        raise ValueError("a power that is beyond all numbers") from None


def _remainder(left: Any, right: Any) -> Any:
    if isinstance(left, str | bytes):  # string formatting, which allows any width
        raise TypeError("% takes numbers")
    return left % right


FUNCTIONS: Mapping[str, Callable[..., Any]] = {
    **{name: getattr(math, name) for name in MATHS},
    **{f.__name__: f for f in (abs, all, any, bool, dict, enumerate, float, int, len, list)},
    **{f.__name__: f for f in (max, min, round, sorted, str, sum, tuple, zip)},
    "range": _range,
}

OPERATORS = {
    **{node: does for node, does in DEFAULT_OPERATORS.items() if node not in (ast.LShift, ast.RShift)},
    ast.Pow: _power,
    ast.Mod: _remainder,
    ast.Is: operator.is_,
}


class _Anything:
    """Every public name; simpleeval itself refuses names with an underscore in front."""

    def __contains__(self, name: object) -> bool:
        return True


def namespaces(**xacro: Callable[..., Any]) -> dict[str, SimpleNamespace]:
    """``math``, ``python`` and ``xacro``, whose functions are called with a dot."""
    return {
        "math": SimpleNamespace(
            **{name: FUNCTIONS[name] for name in MATHS}, pi=math.pi, e=math.e, tau=math.tau
        ),
        "python": SimpleNamespace(**{name: f for name, f in FUNCTIONS.items() if name not in MATHS}),
        "xacro": SimpleNamespace(**xacro),
    }


class _Evaluator(EvalWithCompoundTypes):
    def __init__(
        self, names: Any, functions: Mapping[str, Callable[..., Any]], open_types: tuple[type, ...]
    ) -> None:
        allowed = {
            **BASIC_ALLOWED_ATTRS,
            str: TEXT,
            **dict.fromkeys((SimpleNamespace, *open_types), _Anything()),
        }
        super().__init__(OPERATORS, {**FUNCTIONS, **functions}, names, allowed_attrs=allowed)
        for formatted in (ast.JoinedStr, ast.FormattedValue):  # these allow any width
            self.nodes.pop(formatted, None)


def evaluate(
    expression: str,
    names: Any,
    functions: Mapping[str, Callable[..., Any]] = MappingProxyType({}),
    open_types: tuple[type, ...] = (),
) -> Any:
    """The value of an expression.

    Args:
        expression: text.
        names: looks variables up.
        functions: allowed functions besides arithmetic and the like, by name.
        open_types: types of variables whose attributes are accessible.

    Raises any error of the expression; the caller adds its location.
    """
    value = _Evaluator(names, functions, open_types).eval(expression)
    if isinstance(value, int) and abs(value) > LARGEST_WHOLE:
        raise ValueError("a whole number of more than 20 digits")
    return value
