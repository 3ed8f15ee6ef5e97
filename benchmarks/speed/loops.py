"""Compiled loops around one evaluation, so that no interpreter is in the timing.

Times are processor time of the loop's own thread, the minimum of several repeats; other programs on the
machine lengthen wall time and, through shared caches, processor time too, which the minimum mostly removes.
"""

from __future__ import annotations

import ctypes
import hashlib
import os
import shutil
import subprocess
import time
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path

import casadi as ca
import mujoco
import numpy as np
import pinocchio
from numpy.typing import NDArray

from benchmarks.speed.rigid_peers import MujocoPeer, PinocchioPeer, States, body_columns, random_states
from reference_model.codegen.compiled import compiled
from reference_model.evaluation.forward import ForwardDynamics
from reference_model.evaluation.model import RobotModel
from reference_model.flexible.undeformed import undeformed
from reference_model.kinematics.spatial import rotation_from_rpy
from reference_model.passive.base_motion import BaseMotion
from robot_model import Inertial, Joint, Robot

__all__ = [
    "REPEATS",
    "Loop",
    "agreement",
    "from_python",
    "mujoco_loop",
    "own_from_python",
    "own_loop",
    "pinocchio_loop",
]

Array = NDArray[np.float64]
#: Processor seconds per evaluation, by calling it.
Loop = Callable[[], float]

REPEATS = 15
#: Evaluations of one repeat.
EVALUATIONS = 20_000
DRIVERS = Path(__file__).parent / "drivers"
FOLDER = Path(__file__).parents[2] / ".benchmarks" / "loops"
#: Compiler flags of the peers' loops: the fastest that their authors recommend.
PEER_FLAGS = ("-O3", "-march=native", "-DNDEBUG", "-shared", "-fPIC")
#: Pinocchio's own settings of Boost, for its long list of joint types.
BOOST = ("-DBOOST_MPL_LIMIT_LIST_SIZE=30", "-DBOOST_MPL_CFG_NO_PREPROCESSED_HEADERS")


def _pointer(array: NDArray[np.generic]) -> ctypes.c_void_p:
    return array.ctypes.data_as(ctypes.c_void_p)


@cache
def _driver(name: str, compiler: str, more: tuple[str, ...] = ()) -> ctypes.CDLL:
    """A driver, compiled once per content, versions of the peers and flags; Pinocchio's takes minutes."""
    source = DRIVERS / name
    parts = (source.read_text(), *PEER_FLAGS, *more, mujoco.__version__, pinocchio.__version__)
    key = hashlib.sha256("\0".join(parts).encode()).hexdigest()[:16]
    library = FOLDER / f"{source.stem}-{key}.so"
    if not library.exists():
        FOLDER.mkdir(parents=True, exist_ok=True)
        path = shutil.which(compiler)
        if path is None:
            raise FileNotFoundError(f"no {compiler} on the path")
        made = library.with_suffix(f".{os.getpid()}")
        subprocess.run([path, *PEER_FLAGS, str(source), *more, "-o", str(made)], check=True)
        made.replace(library)
    found = ctypes.CDLL(str(library))
    getattr(found, source.stem).restype = ctypes.c_double
    return found


def agreement(robot: Robot) -> tuple[float, float]:
    """Largest difference of MuJoCo's and of Pinocchio's accelerations from ours, over the largest of all."""
    robot = undeformed(robot)
    states = random_states(robot)
    still = np.zeros((len(states), 3))
    velocity = states.base_velocity
    base = BaseMotion(states.attitude, velocity[:, 3:], velocity[:, :3], still, still)
    motion = (states.position, states.velocity, states.torque)
    own = RobotModel(robot).forward_dynamics(*motion, base=base if robot.base.kind == "free" else None)
    peers = MujocoPeer(robot, states), PinocchioPeer(robot, states)
    first, second = (float(np.abs(p.accelerations() - own).max() / np.abs(own).max()) for p in peers)
    return first, second


def own_loop(
    function: ca.Function, columns: Sequence[Array], *, evaluations: int = EVALUATIONS, tuned: bool = False
) -> Loop:
    """A compiled function over columns of inputs, shape (N, rows) each; `tuned` as `compiled` takes it.

    Raises:
        RuntimeError: the function could not be compiled.
    """
    code = compiled([function], tuned=tuned)
    if code.library is None:
        raise RuntimeError(code.note)
    library = ctypes.CDLL(str(code.library))
    evaluate = getattr(library, function.name())
    driver = _driver("own_loop.c", "gcc").own_loop
    inputs = [np.ascontiguousarray(column, dtype=float) for column in columns]
    rows = np.array([column.shape[1] for column in inputs], dtype=np.int32)
    out, check = np.zeros(function.numel_out(0)), ctypes.c_double()
    results = (ctypes.c_void_p * max(1, function.sz_res()))()
    arguments = (ctypes.c_void_p * max(1, function.sz_arg()))()
    addresses = (ctypes.c_void_p * len(inputs))(*(column.ctypes.data for column in inputs))
    whole = np.zeros(max(1, function.sz_iw()), dtype=np.int64)
    work = np.zeros(max(1, function.sz_w()))

    def run() -> float:
        used = driver(
            ctypes.cast(evaluate, ctypes.c_void_p),
            *(len(inputs), addresses, _pointer(rows), len(inputs[0]), ctypes.c_long(evaluations)),
            *(_pointer(out), len(out), results, arguments, _pointer(whole), _pointer(work)),
            ctypes.byref(check),
        )
        assert np.isfinite(check.value)
        return float(used) / evaluations

    return run


def mujoco_loop(robot: Robot, states: States) -> Loop:
    """mj_forward, in MuJoCo's own library."""
    peer = MujocoPeer(robot, states)
    home = Path(mujoco.__file__).parent
    library = next(home.glob("libmujoco.so*"))
    more = (f"-I{home / 'include'}", str(library), f"-Wl,-rpath,{home}")
    driver = _driver("mujoco_loop.c", "gcc", more).mujoco_loop
    file = FOLDER / f"{robot.name}.xml"
    file.write_text(peer.xml)
    check = ctypes.c_double()

    def run() -> float:
        arrays = (_pointer(peer.qpos), _pointer(peer.qvel), _pointer(peer.force))
        count = ctypes.c_long(EVALUATIONS)
        used = driver(os.fsencode(file), *arrays, len(states), count, ctypes.byref(check))
        assert used >= 0
        return float(used) / EVALUATIONS

    return run


def pinocchio_loop(robot: Robot, states: States) -> Loop:
    """aba, from Pinocchio's headers."""
    prefix = next(p for p in Path(pinocchio.__file__).parents if p.name == "cmeel.prefix")
    more = ("-std=c++17", *BOOST, f"-I{prefix / 'include'}", f"-I{prefix / 'include' / 'eigen3'}")
    driver = _driver("pinocchio_loop.cpp", "g++", more).pinocchio_loop
    peer = PinocchioPeer(robot, states)
    tables = _tables(robot)
    gravity, check = np.array(robot.gravity, dtype=float), ctypes.c_double()
    rotor = np.ascontiguousarray(peer.model.armature)

    def run() -> float:
        used = driver(
            len(tables[0]),
            *(_pointer(table) for table in (*tables, rotor, gravity, peer.q, peer.v, peer.force)),
            *(len(states), ctypes.c_long(EVALUATIONS), ctypes.byref(check)),
        )
        return float(used) / EVALUATIONS

    return run


def _tables(robot: Robot) -> tuple[NDArray[np.generic], ...]:
    """Parent, kind, axis, place and mass of every joint, in the order of `PinocchioPeer`."""
    identity = [*np.eye(3).ravel(), 0, 0, 0]
    rows: list[tuple[int, int, Array, Array, Array]] = []
    index = {"base": 0}

    def mass(body: Inertial) -> Array:
        return np.array([body.mass, *body.center_of_mass, *body.inertia_matrix.ravel()])

    if robot.base.kind == "free":
        rows.append((0, 0, np.zeros(3), np.array(identity), mass(robot.base)))
        index["base"] = 1
    for joint, link in body_columns(robot):
        place = np.array([*rotation_from_rpy(joint.rpy).ravel(), *joint.origin])
        rows.append((index[joint.parent], _kind(joint), joint.unit_axis, place, mass(link)))
        index[joint.child] = len(rows)
    parent, kind, *numbers = zip(*rows)
    integers = np.array(parent, dtype=np.int32), np.array(kind, dtype=np.int32)
    return (*integers, *(np.ascontiguousarray(np.array(column, dtype=float)) for column in numbers))


def _kind(joint: Joint) -> int:
    if joint.kind == "prismatic":
        return 5
    matches = [k + 1 for k, unit in enumerate(np.eye(3)) if np.array_equal(joint.unit_axis, unit)]
    return matches[0] if matches else 4


def from_python(call: Callable[[int], object], states: int, *, evaluations: int = 3_000) -> Loop:
    """An evaluation called from a loop in Python."""

    def run() -> float:
        start = time.thread_time()
        for k in range(evaluations):
            call(k % states)
        return (time.thread_time() - start) / evaluations

    return run


def own_from_python(robot: Robot, states: States) -> Loop:
    """The compiled function called from a loop in Python, its arguments written where it reads them."""
    own = ForwardDynamics(robot)
    position, velocity, force, evaluate = own.position, own.velocity, own.force, own.evaluate
    free = robot.base.kind == "free"
    positions = np.hstack([states.attitude, states.position]) if free else states.position
    velocities = np.hstack([states.base_velocity, states.velocity]) if free else states.velocity
    torques, acceleration = np.ascontiguousarray(states.torque), own.acceleration

    def call(k: int) -> object:
        position[:], velocity[:], force[:] = positions[k], velocities[k], torques[k]
        evaluate()
        return acceleration

    return from_python(call, len(states))
