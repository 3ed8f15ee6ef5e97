"""Control and friction as user functions in C, where Exudyn has no own form for them.

The only Python code is the function called by Exudyn, which starts the compiled code and passes on its
result. Bristles are the rates of coordinates of unit mass; with Jacobians with respect to coordinates, rates
and, for a tree, accelerations there is no memory between steps, so that every method of Exudyn can run it.
"""

from __future__ import annotations

import ctypes
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from benchmarks.native.bodies import Bodies, Joined
from benchmarks.native.engine import exu, items
from benchmarks.native.expressions import Coordinates, Seats, between_bodies, bristles, on_tree
from benchmarks.native.lugre import bristle_node
from benchmarks.native.machine_code import MachineCode, System
from exudyn_model.bodies.mechanism import Mechanism, mechanism_of
from reference_model.codegen.compiled import compiled
from robot_model import Robot

__all__ = ["CompiledLaws"]

Array = NDArray[np.float64]

#: Loops for timing a call, and calls in each.
REPEATS, CALLS = 7, 2000


@dataclass(frozen=True)
class CompiledLaws:
    """The laws of a robot's joints, which can be added to several systems.

    Attributes:
        functions: force, Jacobian and mass matrix, each with the library that holds it as machine code.
        bristles: coordinates that it adds.
        turning: the mass matrix depends on the coordinates.
    """

    functions: Sequence[tuple[ctypes.CDLL, ca.Function]]
    bristles: int
    turning: bool

    @classmethod
    def of(cls, robot: Robot) -> CompiledLaws:
        """Of a robot; flexible ones as bodies, rigid ones as a tree."""
        return cls._between(robot) if robot.flexible_links else cls._on(robot)

    @classmethod
    def _on(cls, robot: Robot) -> CompiledLaws:
        mechanism, count = mechanism_of(robot), bristles(robot)
        size = (6 if mechanism.free else 0) + len(mechanism.coordinate)
        at = Coordinates.of(size + count, 0)
        mass = ca.diag(ca.SX([0.0] * size + [1.0] * count))
        return cls._made(at, on_tree(robot, mechanism, at), mass, range(size + count), count, turning=False)

    @classmethod
    def _between(cls, robot: Robot) -> CompiledLaws:
        count, seen = bristles(robot), _Seen()
        mbs = Bodies(robot, seen).mbs
        data, first = mbs.systemData, mbs.GetNodeODE2Index
        reference = data.GetODE2Coordinates(exu.ConfigurationType.Reference)
        seats = [
            Seats(pair.link, first(pair.nodes[0]), first(pair.nodes[1]), data.GetObjectLTGAE(pair.joint)[0])
            for pair in seen.joined
        ]
        frames = [first(node) + k for node in _nodes(seen.joined) for k in range(7)]
        size = len(reference) + count
        at = Coordinates.of(size, len(data.GetAECoordinates()))
        own = [*frames, *range(size - count, size)]
        whole = np.concatenate([reference, np.zeros(count)])
        force, mass = between_bodies(robot, seats, whole, own, at)
        return cls._made(at, force, mass, own, count, turning=True)

    @classmethod
    def _made(
        cls, at: Coordinates, force: ca.SX, mass: ca.SX, own: Sequence[int], count: int, *, turning: bool
    ) -> CompiledLaws:
        slopes = [ca.jacobian(force, column)[:, list(own)] for column in (at.x, at.v, at.a)]
        jacobian = -sum(at.weights[k] * slope for k, slope in enumerate(slopes))
        # CasADi stores by columns, NumPy by rows.
        values = {"force": force, "jacobian": jacobian.T, "mass": mass.T}
        functions = [
            ca.Function(f"exudyn_{name}", at.inputs, [ca.densify(value)], {"cse": True})
            for name, value in values.items()
        ]
        return cls([(_library(function), function) for function in functions], count, turning)

    def on_tree(self, mbs: Any, mechanism: Mechanism, first: int) -> Any:
        """Add them to a tree; returns objects that must outlive the run."""
        return self._add(mbs, [0])

    def on_bodies(self, mbs: Any, joined: Sequence[Joined]) -> Any:
        """Add them between bodies; returns objects that must outlive the run."""
        return self._add(mbs, _nodes(joined))

    def _add(self, mbs: Any, nodes: list[int]) -> Any:
        nodes = [*nodes, bristle_node(mbs, self.bristles)] if self.bristles else nodes
        called = _Called(mbs, self.functions)
        size = self.functions[0][1].size_out(0)[0]
        mass: dict[str, Any] = {"massMatrix": np.diag([0.0] * (size - self.bristles) + [1.0] * self.bristles)}
        if self.turning:
            mass = {"massMatrixUserFunction": called.mass}
        mbs.AddObject(
            items.ObjectGenericODE2(
                nodeNumbers=nodes,
                forceUserFunction=called.force,
                jacobianUserFunction=called.jacobian,
                **mass,
            )
        )
        return called


def _library(function: ca.Function) -> ctypes.CDLL:
    """A function as machine code."""
    code = compiled([function], tuned=True)
    if code.library is None:
        raise FileNotFoundError(f"Exudyn's user functions are to be machine code, but: {code.note}")
    return ctypes.CDLL(str(code.library))


class _Called:
    """The functions called by Exudyn.

    The machine code reads coordinates and rates directly, not the arguments of the call.
    """

    def __init__(self, mbs: Any, functions: Sequence[tuple[ctypes.CDLL, ca.Function]]) -> None:
        self._mbs, self._functions = mbs, functions
        self._system: System | None = None

    def _begin(self) -> System:
        """Find Exudyn's memory, which does not move once the system is assembled."""
        self._system = system = System(self._mbs)
        self._force, self._jacobian, self._mass = (MachineCode(*own, system) for own in self._functions)
        return system

    def force(self, mbs: Any, t: float, item: int, q: Sequence[float], v: Sequence[float]) -> list[float]:
        """Forces on the coordinates."""
        (self._system or self._begin()).time[0] = t
        return self._force().tolist()  # type: ignore[no-any-return]

    def jacobian(
        self,
        mbs: Any,
        t: float,
        item: int,
        q: Sequence[float],
        v: Sequence[float],
        by_position: float,
        by_velocity: float,
    ) -> Array:
        """Of minus the forces, by coordinates and rates with these weights, and by accelerations.

        Coordinates, rates and accelerations change as beta h^2, gamma h and 1 times what Newton's iterations
        seek; with the trapezoidal rule's beta = 1/4 and gamma = 1/2 the last is the second squared over the
        first.
        """
        system = self._system or self._begin()
        system.time[0] = t
        system.weights[:] = by_position, by_velocity, by_velocity**2 / by_position
        return self._jacobian()

    def costs(self) -> Mapping[str, float]:
        """Processor time of one call of each function in the present state [s], the least of some loops."""
        none: list[float] = []
        calls = {
            "force": lambda: self.force(self._mbs, 0.0, 0, none, none),
            "jacobian": lambda: self.jacobian(self._mbs, 0.0, 0, none, none, 1.0, 1.0),
            "mass": lambda: self.mass(self._mbs, 0.0, 0, none, none),
        }
        return {name: _least(call) for name, call in calls.items()}

    def mass(self, mbs: Any, t: float, item: int, q: Sequence[float], v: Sequence[float]) -> Array:
        """Mass matrix of the rotors and bristles."""
        if self._system is None:
            self._begin()
        return self._mass()


def _least(call: Callable[[], object]) -> float:
    found = []
    for _ in range(REPEATS):
        start = time.process_time()
        for _ in range(CALLS):
            call()
        found.append((time.process_time() - start) / CALLS)
    return min(found)


class _Seen:
    """Empty laws, to inspect a system."""

    joined: Sequence[Joined] = ()

    def on_bodies(self, mbs: Any, joined: Sequence[Joined]) -> None:
        self.joined = joined


def _nodes(joined: Sequence[Joined]) -> list[int]:
    """Frames of all joined bodies, each once."""
    return list(dict.fromkeys(node for pair in joined for node in pair.nodes))
