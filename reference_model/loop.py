"""Closing the loop of bearing loads and friction inside an expression."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca

__all__ = ["NEWTON_PASSES", "Affine", "fixed_point"]

#: Newton passes. Each squares the error; where loads move friction by a tenth of the friction's own change,
#: four reach rounding, and two are in reserve. The simulation looks at the error that is left.
NEWTON_PASSES = 6


@dataclass(frozen=True)
class Affine:
    """``constant + slope @ x`` of the joint forces x, all columns."""

    constant: ca.SX
    slope: ca.SX

    @classmethod
    def of(cls, function: Callable[[ca.SX], ca.SX], size: int) -> Affine:
        """The two parts of a function that is affine in its `size` x 1 argument."""
        x = ca.SX.sym("x", size)
        return cls(function(ca.SX(size, 1)), ca.jacobian(function(x), x))

    @classmethod
    def symbols(cls, like: Affine) -> Affine:
        """Fresh dense symbols of the same shapes."""
        return cls(ca.SX.sym("a", *like.constant.shape), ca.SX.sym("s", *like.slope.shape))

    def at(self, x: ca.SX) -> ca.SX:
        """The value at x."""
        return self.constant + self.slope @ x

    def then(self, function: Callable[[ca.SX], ca.SX]) -> Affine:
        """An affine function of this one, as a function of x."""
        y = ca.SX.sym("y", self.constant.shape[0])
        return Affine(function(self.constant), ca.jacobian(function(y), y) @ self.slope)


def fixed_point(forces: Callable[[ca.SX], ca.SX], seen: Affine) -> ca.SX:
    """The joint forces x with ``x = forces(seen(x))``, by Newton from zero, as one expression.

    Args:
        forces: from what `seen` gives to the joint forces, n x 1.
        seen: accelerations and reaction wrenches in one column, as a function of the forces.
    """
    size = seen.slope.shape[1]
    x = ca.SX.sym("force", size)
    symbols = Affine.symbols(seen)
    gap = forces(symbols.at(x)) - x
    step = ca.densify(x - ca.solve(ca.densify(ca.jacobian(gap, x)), ca.densify(gap)))
    own = [x, symbols.constant, symbols.slope]
    inside = {symbol.element_hash() for column in own for symbol in ca.symvar(column)}
    outer = [symbol for symbol in ca.symvar(step) if symbol.element_hash() not in inside]
    newton = ca.Function("newton", [*own, *outer], [step], {"cse": True})
    found = ca.SX.zeros(size)
    for _ in range(NEWTON_PASSES):
        found = newton(found, seen.constant, seen.slope, *outer)
    return found
