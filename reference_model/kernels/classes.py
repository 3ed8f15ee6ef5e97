"""Functions that differ only in their constants, as one function with the constants as an argument.

Every body of a robot has its own expression graph. Two bodies of a class, such as two links on revolute
joints about y, have graphs that differ only in their numbers. With the numbers as one more input, the graph
is generated and compiled once.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi as ca
import numpy as np

__all__ = ["BodyClasses"]


class BodyClasses:
    """Functions by their graphs; each new graph becomes a new function, a known one is reused."""

    def __init__(self) -> None:
        self._known: dict[tuple[Any, ...], ca.Function] = {}

    def __len__(self) -> int:
        return len(self._known)

    def call(self, function: ca.Function, arguments: Sequence[ca.MX]) -> list[ca.MX]:
        """`function` of the arguments, as a call of the function of its class.

        Args:
            function: of scalar operations, sparse inputs and outputs.
            arguments: one for each input.
        """
        key, constants = _parts(function)
        if key not in self._known:
            self._known[key] = _with_inputs(function, len(constants), f"body_{len(self._known)}")
        numbers = ca.MX(ca.DM(constants)) if constants else ca.MX(0, 1)
        found = self._known[key].call([*arguments, numbers], False, True)
        return list(found)


def _parts(function: ca.Function) -> tuple[tuple[Any, ...], list[float]]:
    """The key of a class, and the constants in the order of the graph."""
    steps: list[Any] = [
        *(function.sparsity_in(k).hash() for k in range(function.n_in())),
        *(function.sparsity_out(k).hash() for k in range(function.n_out())),
    ]
    constants = []
    for k in range(function.n_instructions()):
        operation = function.instruction_id(k)
        if operation == ca.OP_CONST:
            constants.append(function.instruction_constant(k))
            steps.append((operation, *function.instruction_output(k)))
        else:
            steps.append((operation, *function.instruction_input(k), *function.instruction_output(k)))
    return tuple(steps), constants


def _with_inputs(function: ca.Function, count: int, name: str) -> ca.Function:
    """The same function with its constants as a last input, `count` x 1."""
    inputs = [ca.SX.sym(f"i{k}", function.sparsity_in(k)) for k in range(function.n_in())]
    constants = ca.SX.sym("c", count)
    values = [part.nonzeros() for part in inputs]
    numbers = iter(constants.nonzeros())
    work: dict[int, Any] = {}
    results = [np.empty(function.nnz_out(k), dtype=object) for k in range(function.n_out())]
    for k in range(function.n_instructions()):
        operation = function.instruction_id(k)
        read, written = function.instruction_input(k), function.instruction_output(k)
        if operation == ca.OP_CONST:
            work[written[0]] = next(numbers)
        elif operation == ca.OP_INPUT:
            work[written[0]] = values[read[0]][read[1]]
        elif operation == ca.OP_OUTPUT:
            results[written[0]][written[1]] = work[read[0]]
        elif len(read) == 1:
            work[written[0]] = ca.SX.unary(operation, work[read[0]])
        else:
            work[written[0]] = ca.SX.binary(operation, work[read[0]], work[read[1]])
    outputs = [
        ca.SX(function.sparsity_out(k), ca.vertcat(*own) if len(own) else ca.SX(0, 1))
        for k, own in enumerate(results)
    ]
    return ca.Function(name, [*inputs, constants], outputs, {"never_inline": True})
