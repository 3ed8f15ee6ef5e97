"""The state derivative as a loop over bodies, whose code and compile time do not grow with the robot.

The straight-line code of a long chain has a hundred thousand assignments, outgrows the processor's caches and
takes minutes to compile. Here the three passes of the articulated-body method (docs/theory.md (21)) are
functions of one body each, generated once for each class of bodies and called for every body: outwards
velocities and forces, inwards articulated inertias, outwards accelerations. Parameters of a body are data.

A short chain is faster as straight-line code, where zeros and constants of every body are known; see
`LOOPED_FROM`. Robots with implicit forces (friction from bearing loads), with motors behind elastic gears or
on several joints, with outer forces on bodies or a held base have no loop and use straight-line code.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import casadi as ca

from reference_model.control.laws import drive
from reference_model.dynamics.balance import LOADS
from reference_model.dynamics.equations import solve_spd
from reference_model.dynamics.inertial import BodyMass, body_names, mass_of
from reference_model.dynamics.tree import Body, BodyState, State, Tree, across
from reference_model.kernels.classes import BodyClasses
from reference_model.kinematics.spatial import quaternion_from_rpy, rotation_from_quaternion
from reference_model.plant.acting import Signals
from reference_model.plant.closed_loop import Plant, Response

__all__ = ["LOOPED_FROM", "looped_rate", "rate_by_size"]

#: Operations of the straight-line code from which on the loop is faster: measured on chains of 2 to 64 links,
#: 0.8 times as fast at 5,000 operations, 1.3 times at 9,000, 1.4 times at 12,000 and twice as fast at 26,000.
LOOPED_FROM = 8_000


def rate_by_size(plant: Plant) -> ca.Function:
    """(t, x, r, command) -> time derivative of the state, by a loop over the bodies where that is faster."""
    if plant.rate.n_instructions() < LOOPED_FROM:
        return plant.rate
    return looped_rate(plant) or plant.rate


def looped_rate(plant: Plant) -> ca.Function | None:
    """(t, x, r, command) -> time derivative of the state, by a loop; None for robots that have none."""
    outer = plant.truth.forces.acts
    if plant.forces.needs_solving() or plant.gears.drives or outer or plant.wrench or plant.layout.work:
        return None
    if plant.mode is not None or plant.layout.balls or plant.robot.transmissions:
        return None
    time, state = ca.MX.sym("t"), ca.MX.sym("x", plant.layout.size)
    reference, held = ca.MX.sym("r", plant.layout.joints), ca.MX.sym("command", plant.commands)
    force, rest = _around(plant)
    moved = _Loop(plant).accelerations(state, force(time, state, held))
    rate = rest(time, state, reference, held, moved)
    return ca.Function("rate", [time, state, reference, held], [rate])


def _around(plant: Plant) -> tuple[ca.Function, ca.Function]:
    """(t, x, command) -> forces on the joints, and (t, x, r, command, accelerations) -> rate."""
    count = plant.layout.joints
    time, state = ca.SX.sym("t"), ca.SX.sym("x", plant.layout.size)
    reference, held = ca.SX.sym("r", count), ca.SX.sym("command", plant.commands)
    acceleration = ca.SX.sym("a", plant.tree.rows)
    parts = plant.layout.split(state)
    torque = drive(plant.robot, held, parts["velocity"])
    offset = plant.tree.offset
    signals = Signals(
        time,
        parts["position"],
        parts["velocity"],
        acceleration[offset : offset + count],
        torque,
        ca.SX(len(LOADS), count),
    )
    total, rates, friction = plant.forces.act(signals, parts["effects"])
    own = ca.densify(torque + total)
    response = Response(acceleration, friction, signals.loads, rates, ca.SX(1, 1), drive=torque)
    rate = plant.rate_with(parts, reference, held, response)
    return (
        ca.Function("joint_forces", [time, state, held], [own], {"never_inline": True}),
        ca.Function("rest", [time, state, reference, held, acceleration], [rate], {"never_inline": True}),
    )


@dataclass(frozen=True)
class _Passed:
    """Data of one body between the passes; a constant part is None and built into the code.

    Attributes:
        outward: transfer, bias, hinge, mass matrix, force column.
        velocity, gravity, modal, rate: inputs of the outboard bodies.
    """

    outward: tuple[ca.MX, ...]
    velocity: ca.MX
    gravity: ca.MX
    modal: ca.MX
    rate: ca.MX


class _Loop:
    """The articulated-body method over MX calls of functions of one body."""

    def __init__(self, plant: Plant) -> None:
        self._tree, self._layout = plant.tree, plant.layout
        self._bodies = BodyClasses()
        names = body_names(plant.truth.robot)
        numbers, start = plant.inertial, 10 * len(names)
        self._tens = {name: ca.SX(numbers[10 * k : 10 * k + 10]) for k, name in enumerate(names)}
        count = len(self._tree.joints)
        self._rotors = numbers[start : start + count]
        self._gravity = ca.DM(numbers[start + count : start + count + 3])
        self._still = ca.DM(quaternion_from_rpy(plant.truth.robot.base.rpy))
        self._outward = {
            index: _outward(self._tree, body, self._tens[body.name])
            for index, body in enumerate(self._tree.bodies)
            if index
        }

    def accelerations(self, state: ca.MX, force: ca.MX) -> ca.MX:
        """Generalised accelerations, rows x 1, of the forces on the joints."""
        tree = self._tree
        parts = self._layout.split(state)
        forces = _singles(force)
        passed = self._pass_outwards(parts)
        solved: list[tuple[ca.MX, ca.MX]] = [(ca.MX(), ca.MX())] * len(tree.bodies)
        gathered: list[list[tuple[ca.MX, ca.MX]]] = [[] for _ in tree.bodies]
        for index in range(len(tree.bodies) - 1, 0, -1):
            body = tree.bodies[index]
            own = forces[body.coordinate] if body.coordinate >= 0 else ca.MX(0, 1)
            inertia, column = _sums(gathered[index], 6 + body.modes)
            step = _inward(self._outward[index], self._rotor(body))
            *kept, felt, pushed = self._bodies.call(step, [*passed[index].outward, inertia, column, own])
            solved[index] = kept[0], kept[1]
            gathered[body.parent].append((felt, pushed))
        moved = [self._base(passed[0], gathered[0]) if tree.free_base else ca.MX(6, 1)]
        joints: list[ca.MX] = [ca.MX(1, 1)] * len(tree.joints)
        modal = []
        for index, body in enumerate(tree.bodies[1:], start=1):
            step = _final(self._outward[index])
            arguments = [*passed[index].outward[:3], *solved[index], moved[body.parent]]
            own, value = self._bodies.call(step, arguments)
            moved.append(value)
            if body.coordinate >= 0:
                joints[body.coordinate] = own[0]
            if body.modes:
                modal.append((body.modal, own[own.shape[0] - body.modes :]))
        inner = [value for _, value in sorted(modal, key=lambda pair: pair[0])]
        return ca.vertcat(*([moved[0]] if tree.free_base else []), *joints, *inner)

    def _rotor(self, body: Body) -> float:
        return float(self._rotors[body.coordinate]) if body.coordinate >= 0 else 0.0

    def _pass_outwards(self, parts: dict[str, ca.MX]) -> list[_Passed]:
        position, velocity = _singles(parts["position"]), _singles(parts["velocity"])
        found = [self._first(parts)]
        none = ca.MX(0, 1)
        for index, body in enumerate(self._tree.bodies[1:], start=1):
            outward, inboard = self._outward[index], found[body.parent]
            own = slice(body.modal, body.modal + body.modes)
            x, rate = (parts[name][own] if body.modes else ca.MX(0, 1) for name in ("modal", "modal_rates"))
            place = body.coordinate
            joint = (position[place], velocity[place]) if place >= 0 else (none, none)
            seen = [inboard.velocity, inboard.gravity, inboard.modal, inboard.rate]
            *kept, column, gravity = self._bodies.call(outward.function, [*seen, *joint, x, rate])
            found.append(_Passed(tuple(kept), column, gravity, x, rate))
        return found

    def _first(self, parts: dict[str, ca.MX]) -> _Passed:
        """Of the base."""
        none = ca.MX(0, 1)
        if not self._tree.free_base:
            still = rotation_from_quaternion(ca.SX(self._still)).T @ ca.SX(self._gravity)
            return _Passed((), ca.MX(ca.DM.zeros(6)), ca.MX(ca.evalf(ca.densify(still))), none, none)
        attitude = ca.SX.sym("a", 4)
        turned = ca.densify(rotation_from_quaternion(attitude).T @ ca.SX(self._gravity))
        gravity = ca.Function("turned", [attitude], [turned], {"never_inline": True})
        return _Passed((), parts["base_velocity"], gravity(parts["attitude"]), none, none)

    def _base(self, passed: _Passed, gathered: Sequence[tuple[ca.MX, ca.MX]]) -> ca.MX:
        """Acceleration of a free base."""
        velocity, gravity = ca.SX.sym("v", 6), ca.SX.sym("g", 3)
        state = _resting(velocity)
        mass = mass_of(self._tree.bodies[0], state, self._tens["base"])
        upper, column = ca.SX.sym("I", ca.Sparsity.upper(6)), ca.SX.sym("p", 6)
        inertia = mass.matrix + ca.triu2symm(upper)
        found = solve_spd(inertia, mass.force + mass.weight @ gravity - column)
        own = [velocity, gravity, upper, column]
        step = ca.Function("base", own, [ca.densify(found)], {"never_inline": True, "cse": True})
        return step(passed.velocity, passed.gravity, *_sums(gathered, 6))


def _resting(velocity: ca.SX) -> BodyState:
    """A body relative to itself."""
    one = ca.SX.eye(6)
    return BodyState(ca.SX(6, 0), one, ca.SX(6, 1), velocity, ca.SX.eye(3), ca.SX(3, 1), one, ca.SX(0, 1))


@dataclass(frozen=True)
class _Outward:
    """The first pass over one body.

    Attributes:
        function: (v_j, g_j, x_j, xd_j, q, qd, x, xd) -> transfer, bias, hinge, mass, force, v, g; parts that
            are constant have no elements.
        parts: transfer, bias, hinge, mass matrix (upper half) and force column as expressions or constants.
        constant: which of the parts are constant.
    """

    function: ca.Function
    parts: tuple[ca.SX, ...]
    constant: tuple[bool, ...]

    def symbols(self) -> tuple[list[ca.SX], list[ca.SX]]:
        """Inputs of a later pass for all five parts, empty for constants, and the parts by them."""
        inputs = [
            ca.SX.sym("none", 0) if known else ca.SX.sym("p", part.sparsity())
            for part, known in zip(self.parts, self.constant)
        ]
        return inputs, [own if part is None else part for own, part in zip(inputs, self._known)]

    @property
    def _known(self) -> list[ca.SX | None]:
        return [part if known else None for part, known in zip(self.parts, self.constant)]


def _outward(tree: Tree, body: Body, ten: ca.SX) -> _Outward:
    """Quantities of one body, relative to its inboard body."""
    parent = replace(tree.bodies[body.parent], modal=0)
    alone = replace(body, parent=0, coordinate=min(body.coordinate, 0), modal=parent.modes)
    velocity, gravity = ca.SX.sym("v", 6 + parent.modes), ca.SX.sym("g", 3)
    outer = [ca.SX.sym(name, parent.modes) for name in ("xj", "xdj")]
    joint = [ca.SX.sym(name, 1 if body.coordinate >= 0 else 0) for name in ("q", "qd")]
    own = [ca.SX.sym(name, body.modes) for name in ("x", "xd")]
    state = State(
        joint[0],
        joint[1],
        ca.SX(4, 1),
        velocity[:6],
        ca.SX(3, 1),
        modal=ca.vertcat(outer[0], own[0]),
        modal_rates=ca.vertcat(outer[1], own[1]),
    )
    seen = across(Tree((parent, alone), (), False), alone, replace(_resting(velocity), modal=outer[0]), state)
    mass: BodyMass = mass_of(alone, seen, ten)
    here = seen.rotation.T @ gravity
    column = ca.densify(mass.force + mass.weight @ here)
    parts = (seen.transfer, ca.densify(seen.bias), seen.hinge, ca.triu(mass.matrix), column)
    constant = tuple(not ca.symvar(part) for part in parts)
    passed = [ca.SX(0, 1) if known else part for part, known in zip(parts, constant)]
    inputs = [velocity, gravity, *outer, *joint, *own]
    outputs = [*passed, ca.densify(seen.velocity), ca.densify(here)]
    return _Outward(ca.Function("outward", inputs, outputs, {"cse": True}), parts, constant)


def _inward(outward: _Outward, rotor: float) -> ca.Function:
    """(parts, inertia and bias of outboard bodies, force) -> response, alone, felt, pushed."""
    inputs, (transfer, bias, hinge, mass, force) = outward.symbols()
    size = transfer.shape[0]
    upper, column = ca.SX.sym("I", ca.Sparsity.upper(size)), ca.SX.sym("p", size)
    modes, own = size - 6, hinge.shape[1] - (size - 6)
    applied = ca.SX.sym("f", own)
    inertia = ca.triu2symm(mass) + ca.triu2symm(upper)
    pushed = column - force
    lever = inertia @ hinge
    reflected = ca.SX(own + modes, own + modes)
    if own:
        reflected[0, 0] = rotor
    left = ca.vertcat(applied, ca.SX(modes, 1)) - hinge.T @ pushed
    both = solve_spd(hinge.T @ lever + reflected, ca.horzcat(lever.T, left))
    response, alone = both[:, :-1], both[:, -1]
    seen = ca.triu2symm(ca.triu(inertia - lever @ response))
    pushed = pushed + lever @ alone + seen @ bias
    felt = ca.triu(transfer.T @ seen @ transfer)
    outputs = [ca.densify(response), ca.densify(alone), _upper(felt), ca.densify(transfer.T @ pushed)]
    return ca.Function("inward", [*inputs, upper, column, applied], outputs, {"cse": True})


def _upper(matrix: ca.SX) -> ca.SX:
    """With all elements of the upper half, zeros included."""
    return ca.project(ca.densify(matrix), ca.Sparsity.upper(matrix.shape[0]))


def _final(outward: _Outward) -> ca.Function:
    """(transfer, bias, hinge, response, alone, acceleration inboard) -> own coordinates, acceleration."""
    inputs, (transfer, bias, hinge, *_) = outward.symbols()
    rows = hinge.shape[1]
    response, alone = ca.SX.sym("D", rows, transfer.shape[0]), ca.SX.sym("d", rows)
    inboard = ca.SX.sym("a", transfer.shape[1])
    value = transfer @ inboard + bias
    own = alone - response @ value
    outputs = [ca.densify(own), ca.densify(value + hinge @ own)]
    return ca.Function("final", [*inputs[:3], response, alone, inboard], outputs, {"cse": True})


def _sums(gathered: Sequence[tuple[ca.MX, ca.MX]], size: int) -> tuple[ca.MX, ca.MX]:
    """Upper half of the inertia, and bias, of all outboard bodies together."""
    inertia, column = ca.MX(ca.DM(ca.Sparsity.upper(size), 0.0)), ca.MX(ca.DM.zeros(size))
    for k, (felt, pushed) in enumerate(gathered):
        inertia, column = (felt, pushed) if k == 0 else (inertia + felt, column + pushed)
    return inertia, column


def _singles(column: ca.MX) -> list[ca.MX]:
    return ca.vertsplit(column) if column.shape[0] else []
