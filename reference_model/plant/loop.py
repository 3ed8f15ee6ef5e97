"""Solution of the algebraic loop of bearing loads and friction inside an expression."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import casadi as ca

from robot_model import InputError, Robot

__all__ = ["LOOP_TOLERANCE", "NEWTON_PASSES", "Affine", "fixed_point", "unsettled"]

#: Newton passes. Each squares the error; at violent states of six-joint arms with coefficients up to 0.5
#: three reduce it to less than 1e-12 (tests/reference_model/test_friction_loop.py measures it) and one is in
#: reserve. The simulation checks the remaining error.
NEWTON_PASSES = 4

#: Largest relative residual of the loop of loads and friction before a simulation is refused.
LOOP_TOLERANCE = 1e-10


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


def fixed_point(
    forces: Callable[[ca.SX], ca.SX], seen: Affine, holds: Mapping[int, tuple[ca.SX, int]] | None = None
) -> ca.SX:
    """The joint forces x with ``x = forces(seen(x))``, by Newton from zero, as one expression.

    Explicit forces are inserted directly; Newton runs over the implicit ones.

    Args:
        forces: from the column of `seen` to the joint forces, n x 1.
        seen: accelerations and reaction wrenches in one column, as a function of the forces.
        holds: for a joint that may be held, the condition, and the row of `seen` that its force then keeps at
            zero instead.
    """
    holds = holds or {}
    size = seen.slope.shape[1]
    column = ca.SX.sym("seen", seen.constant.shape[0])
    given = forces(column)
    unknown = [i for i in range(size) if i in holds or ca.depends_on(given[i], column)]
    found = ca.densify(ca.SX(forces(ca.SX(column.shape[0], 1))))
    if not unknown:
        return found
    known = ca.SX(found)
    known[unknown] = 0

    def gap(x: ca.SX, y: ca.SX) -> ca.SX:
        excess = ca.densify(forces(y)[unknown] - x)
        for place, joint in enumerate(unknown):
            if joint in holds:
                held, row = holds[joint]
                excess[place] = ca.if_else(held, y[row], excess[place])
        return excess

    found[unknown] = _newton(
        gap, Affine(seen.constant + seen.slope @ ca.sparsify(known), seen.slope[:, unknown])
    )
    return found


def _newton(gap: Callable[[ca.SX, ca.SX], ca.SX], seen: Affine) -> ca.SX:
    """x with ``gap(x, seen(x)) = 0``."""
    size = seen.slope.shape[1]
    x = ca.SX.sym("force", size)
    symbols = Affine.symbols(seen)
    excess = gap(x, symbols.at(x))
    step = ca.densify(x - ca.solve(ca.densify(ca.jacobian(excess, x)), ca.densify(excess)))
    own = [x, symbols.constant, symbols.slope]
    inside = {symbol.element_hash() for part in own for symbol in ca.symvar(part)}
    outer = [symbol for symbol in ca.symvar(step) if symbol.element_hash() not in inside]
    newton = ca.Function("newton", [*own, *outer], [step], {"cse": True})
    found = ca.SX.zeros(size)
    for _ in range(NEWTON_PASSES):
        found = newton(found, seen.constant, seen.slope, *outer)
    return found


def unsettled(robot: Robot, instant: float) -> InputError:
    """Error for a loop that does not converge at an instant [s]."""
    return InputError(
        f"robot '{robot.name}': bearing loads and the friction they cause do not settle at "
        f"t = {instant:.6g} s; lower the coefficient of load-dependent friction or its arms."
    )
