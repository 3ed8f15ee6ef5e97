"""LuGre friction without loads as a symbolic user function, at the joints of a small tree.

The bristle is the rate of a separate coordinate w of unit mass: w'' = dz/dt, w' = z. Between two free bodies,
with fourteen coordinates and a bristle, this form is not possible; see `LONGEST_VECTOR`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from benchmarks.native.engine import exu, items
from robot_model import Robot

__all__ = ["LONGEST_VECTOR", "Kept", "add_bristles", "bristle_node"]

sym: Any = exu.symbolic
#: Exudyn 1.13 corrupts memory when a symbolic function takes vectors longer than this.
LONGEST_VECTOR = 7
#: Floor of the bristles' friction level, as in `reference_model`.
SMALLEST_LEVEL = 1e-9
#: Symbolic functions must live as long as the items that use them.
Kept = list[Any]


def add_bristles(mbs: Any, robot: Robot, coordinate: Sequence[int], first: int, kept: Kept) -> None:
    """LuGre friction without loads at the joints of a tree, by the formula of `reference_model`'s effect."""
    names = [joint.name for joint in robot.moving_joints]
    uses = [use for use in robot.effects if use.effect == "lugre_friction"]
    if not uses:
        return
    count, rows = first + len(names), [first + coordinate.index(names.index(use.at)) for use in uses]
    if count + len(uses) > LONGEST_VECTOR:
        raise ValueError(f"{count + len(uses)} coordinates are too many for a symbolic function")
    memory = bristle_node(mbs, len(uses))

    def law(mbs: Any, t: Any, itemNumber: Any, q: Any, q_t: Any) -> Any:
        found: list[Any] = [0.0] * (count + len(uses))
        for k, (row, use) in enumerate(zip(rows, uses)):
            found[row], found[count + k] = _lugre(use.parameters, q_t[row], q_t[count + k])
        return found

    mass = np.diag([0.0] * count + [1.0] * len(uses))
    item = mbs.AddObject(
        items.ObjectGenericODE2(nodeNumbers=[0, memory], massMatrix=mass, forceUserFunction=law)
    )
    _given_force(mbs, item, law, len(mass), kept)


def bristle_node(mbs: Any, count: int) -> int:
    """A node of so many bristles at rest."""
    still = [0.0] * count
    return int(
        mbs.AddNode(
            items.NodeGenericODE2(
                referenceCoordinates=still,
                initialCoordinates=still,
                initialCoordinates_t=still,
                numberOfODE2Coordinates=count,
            )
        )
    )


def _lugre(p: Mapping[str, float], v: Any, z: Any) -> tuple[Any, Any]:
    """Force at speed v and deflection z, and the rate of z."""
    stiffness, speed, ratio = p["bristle_stiffness"], sym.abs(v), v * (1 / p["stribeck_velocity"])
    peak = p["static_torque"] - p["coulomb_torque"]
    level = p["coulomb_torque"] + SMALLEST_LEVEL + peak * sym.exp(-(ratio * ratio))
    rate = v - stiffness * speed * z / level
    limit = p.get("damping_limit", 1.0) * p["bristle_damping"] / 4
    damping = p["bristle_damping"] / (1 + limit * speed / level)
    return -(stiffness * z + damping * rate), rate


def _given_force(mbs: Any, item: Any, law: Callable[..., Any], size: int, kept: Kept) -> None:
    """A force on `size` coordinates. Exudyn's own helper records it with vectors of zero length, and the
    result is beyond their end: here it is recorded with vectors of the right length."""
    recording = sym.GetRecording()
    sym.SetRecording(True)
    arguments = [mbs, sym.Real("t", 0.0), sym.Real("itemNumber", 0.0)]
    arguments += [sym.Vector(name, [0.0] * size) for name in ("q", "q_t")]
    value = law(*arguments)
    record = {
        "functionName": "law",
        "argList": arguments,
        "argTypeList": ["MainSystem", "Real", "Index", "StdVector", "StdVector"],
        "returnValue": sym.Vector(value) if isinstance(value, list) else value,
        "returnType": "StdVector",
    }
    sym.SetRecording(recording)
    function = sym.UserFunction()
    function.SetUserFunctionFromDict(mbs, record, "forceUserFunction", item, "None")
    mbs.SetObjectParameter(item, "forceUserFunction", function)
    kept.append((function, record))
