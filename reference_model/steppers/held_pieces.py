"""The course of a sampled controller's loop: pieces between two instants, in which the command is held.

Most pieces are short enough for one explicit step (`explicit_step`). Many of them run as one chain without
returning to Python after each; a piece whose step is not accurate enough (friction near a reversal is stiff)
is left to an implicit method, and the chain continues after it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from reference_model.codegen.batched import Batched, Chain
from reference_model.codegen.compiled import compiled_loops
from reference_model.plant.closed_loop import Plant
from reference_model.steppers.explicit_step import NODES, explicit_step

__all__ = ["SAME_INSTANT", "Piece", "in_pieces"]

Array = NDArray[np.float64]
#: (state, held command, from, to [s]) -> state.
Piece = Callable[[Array, Array, float, float], Array]

#: Two instants closer than this fraction of the sample interval are the same instant up to rounding.
SAME_INSTANT = 1e-9
#: Pieces of a chain: one after a rejected step, more as long as none is rejected.
LENGTHS = (1, 8, 64)


@dataclass(frozen=True)
class _Schedule:
    """Instants at which the controller acts or a state is wanted.

    Attributes:
        instants: [s], shape (P + 1,); the P pieces lie between them.
        acts: where the controller acts, shape (P + 1,).
        wanted: index of the instant of each output.
    """

    instants: Array
    acts: NDArray[np.bool_]
    wanted: NDArray[np.int_]

    @classmethod
    def of(cls, time: Array, hold: float) -> _Schedule:
        """Grid for outputs at `time`, which begins at 0, and a controller that acts every `hold` [s]."""
        ticks = np.arange(int(np.floor(time[-1] / hold * (1 + SAME_INSTANT))) + 1) * hold
        both = np.concatenate([ticks, time])
        order = np.argsort(both, kind="stable")
        group = np.concatenate([[0], np.cumsum(np.diff(both[order]) > SAME_INSTANT * hold)])
        place = np.empty(both.size, dtype=int)
        place[order] = group
        instants, acts = np.empty(group[-1] + 1), np.zeros(group[-1] + 1, dtype=bool)
        instants[place[ticks.size :]] = time
        instants[place[: ticks.size]], acts[place[: ticks.size]] = ticks, True
        return cls(instants, acts, place[ticks.size :])


def in_pieces(
    plant: Plant,
    reference: ca.Function,
    time: Array,
    hold: float,
    *,
    rtol: float,
    atol: float,
    moved: Piece,
    wait: int = 0,
    compile_code: bool = False,
) -> tuple[Array, Array]:
    """States and the commands in force from each instant on, shapes (N, rows).

    Args:
        plant: the closed loop.
        reference: t -> r, rd, rdd.
        time: output instants [s], rising from 0; they only divide the pieces.
        hold: interval over which a command is held [s].
        rtol, atol: tolerances of a step.
        moved: over a piece for which an explicit step is not accurate enough.
        wait: pieces after such a one in which none is tried.
        compile_code: take explicit steps as compiled C where that is possible.
    """
    schedule = _Schedule.of(time, hold)
    given = _given(plant, reference, schedule)
    step = _piece(plant, rtol, atol)
    loops = compiled_loops(step, _chains).functions if compile_code else tuple(_chains(step))
    chains = [Chain(loop, length) for loop, length in zip(loops, LENGTHS)]
    rows, pieces = plant.layout.size, schedule.instants.size - 1
    course = np.empty((pieces + 1, rows + plant.commands))
    last = np.concatenate([plant.initial(reference), np.zeros(plant.commands)])
    law = Chain(_law(plant), 1)
    done, size, waiting = 0, 0, 0
    while done < pieces:
        while size > 0 and done + LENGTHS[size] > pieces:
            size -= 1
        count, good = LENGTHS[size], 0
        if waiting <= 0:
            after, commands, error = chains[size](last, given[done : done + count])
            good = count if (error <= 1).all() else int(np.argmin(error[:, 0] <= 1))
        if good:
            course[done, :rows] = last[:rows]
            course[done + 1 : done + good, :rows] = after[: good - 1, :rows]
            course[done : done + good, rows:] = commands[:good]
            last, done = after[good - 1], done + good
        if good == count:
            size = min(size + 1, len(LENGTHS) - 1)
            continue
        ((command,),) = law(last, given[done : done + 1])
        state = moved(last[:rows], command, *schedule.instants[done : done + 2])
        course[done] = np.concatenate([last[:rows], command])
        last = np.concatenate([state, command])
        done, size, waiting = done + 1, 0, waiting - 1 if waiting > 0 else wait
    ((command,),) = law(last, given[pieces:])
    course[pieces] = np.concatenate([last[:rows], command])
    found = course[schedule.wanted]
    return found[:, :rows], found[:, rows:]


def _given(plant: Plant, reference: ca.Function, schedule: _Schedule) -> Array:
    """Known inputs of each piece, and of the end: see `_piece`, shape (P + 1, K)."""
    instants, along = schedule.instants, Batched(reference)
    lengths = np.append(np.diff(instants), 0.0)
    known = [instants, lengths, schedule.acts, *along(instants[:, None])]
    if plant.layout.integral:
        known += [along((instants + node * lengths)[:, None])[0] for node in NODES]
    return np.column_stack(known)


def _symbols(plant: Plant) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX]:
    """State and command at the start of a piece, its known inputs, and the command in it."""
    joints, size = plant.layout.joints, plant.layout.size
    count = 3 + 3 * joints + (len(NODES) * joints if plant.layout.integral else 0)
    before, given = ca.SX.sym("before", size + plant.commands), ca.SX.sym("given", count)
    goal = ca.vertsplit(given[3 : 3 + 3 * joints], joints) if joints else [ca.SX(0, 1)] * 3
    wish = plant.command(given[0], before[:size], *goal)
    return before[:size], before[size:], given, ca.if_else(given[2], wish, before[size:])


def _law(plant: Plant) -> ca.Function:
    """The command in a piece from what was before it."""
    state, command, given, held = _symbols(plant)
    return ca.Function("law", [ca.vertcat(state, command), given], [ca.densify(held)], {"cse": True})


def _piece(plant: Plant, rtol: float, atol: float) -> ca.Function:
    """One explicit step: [state; command], known inputs -> the same after it, the command, the error.

    Known are the start [s], the length [s], whether the controller acts at the start, the reference and its
    two derivatives there; and, where the loop integrates its error, the reference at each stage of the step.
    The error is relative to the tolerance: above 1 is too much.
    """
    state, command, given, held = _symbols(plant)
    joints = plant.layout.joints
    start, length, stages = given[0], given[1], given[3 + 3 * joints :]

    def rate(part: float, here: ca.SX) -> ca.SX:
        first = NODES.index(part) * joints
        goal = stages[first : first + joints] if plant.layout.integral else ca.SX.zeros(joints)
        return plant.rate(start + part * length, here, goal, held)

    later, error = explicit_step(rate, state, length, rtol=rtol, atol=atol)
    results = [ca.densify(item) for item in (ca.vertcat(later, held), held, error)]
    return ca.Function("piece", [ca.vertcat(state, command), given], results, {"cse": True})


def _chains(step: ca.Function) -> list[ca.Function]:
    return [step.mapaccum(length) for length in LENGTHS]
