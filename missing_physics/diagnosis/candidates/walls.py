"""Where a wall may be that a robot runs against.

A wall at the tip of a link acts when the tip is beyond a plane, and then at all joints by J^T. Which way the
plane faces and where it is are looked for together: for each of many normals the deepest parts of the tip's
way, for each depth the column of a unit stiffness, by the fall of the residual. Normals along the inertial
axes stand for floors and upright walls; another one must be clearly better.

Only the end of a chain is looked at, and one that two joints move: what one joint alone feels of a wall is
an end stop.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from missing_physics.diagnosis.least_squares.explanation import Explanation
from missing_physics.diagnosis.least_squares.problem import Problem
from missing_physics.diagnosis.least_squares.scanning import RIGID_ONLY, Scan
from missing_physics.diagnosis.terms.term import Term
from reference_model.effects.base import Effect
from robot_model import Robot

__all__ = ["chain_ends", "no_walls", "tip_of", "walls"]

Array = NDArray[np.float64]

#: Depths tried, as parts of the tip's way along the normal.
DEPTHS: Array = 0.25 / 1.9 ** np.arange(9, dtype=float)
#: A tip whose way is narrower than this part of its width in some direction does not leave a plane or line.
FLAT = 1e-3
#: Angle between normals in a plane; in space there are those to a cube's corners, edges and faces.
ANGLE = np.deg2rad(5.0)
#: Normals of which a rough look promises most that are looked at closely.
LOOKED_AT = 6
#: Evidence that the grid must promise.
PROMISING = 10.0
#: The offset is looked for within this part of the way.
DEEPEST = 0.5
#: A normal as near to an inertial axis as that leaves it where that adds this part of the evidence: what else
#: is not known, as the damping, tilts it by a little.
WORTH_TILTING = 0.1
NEARLY = np.deg2rad(10.0)
#: First changes of a normal [rad] and of a depth's logarithm when the best of the grid is put right.
FIRST_CHANGE = 0.1


def no_walls(robot: Robot) -> str:
    """Where alone walls are looked for; empty where this robot is such a one."""
    if robot.base.kind == "free":
        return "only on a base that is described as fixed"
    if robot.flexible_links:
        return RIGID_ONLY
    return "only where two joints move" if len(robot.moving_joints) < 2 else ""


def chain_ends(robot: Robot) -> tuple[str, ...]:
    """Links at whose tips walls are looked for."""
    inboard = {joint.parent for joint in robot.joints}
    return tuple(link.name for link in robot.links if link.name not in inboard)


def walls(problem: Problem, explanation: Explanation, effect: Effect) -> Iterator[Term]:
    """The effect at each link at whose tip the best wall of a grid promises something."""
    robot = problem.robot
    if no_walls(robot):
        return
    scan = Scan(explanation)
    for link in chain_ends(robot):
        if (effect.id, link) in {term.key for term in explanation.terms}:
            continue
        point = tip_of(robot, link)
        paths = [segment.pushes.path(link, point) for segment in problem.segments]
        found = _best(scan, np.concatenate([p for p, _ in paths]), np.concatenate([f for _, f in paths]))
        if found is None:
            continue
        normal, offset, span, stiffness = found
        values = {**effect.defaults(), "stiffness": stiffness, "offset": offset}
        values |= dict(zip("xyz", point))
        values |= {f"normal_{axis}": float(part) for axis, part in zip("xyz", normal)}
        yield Term(effect, link, values, narrowed={"offset": span})


def tip_of(robot: Robot, link: str) -> tuple[float, float, float]:
    """A link's tip: where the next joint is, else twice as far as the centre of mass."""
    outboard = [joint.origin for joint in robot.joints if joint.parent == link]
    centre = np.array(robot.link(link).center_of_mass)
    x, y, z = map(float, outboard[0] if outboard else 2.0 * centre)
    return x, y, z


def _best(scan: Scan, place: Array, lever: Array) -> tuple[Array, float, tuple[float, float], float] | None:
    """Normal, offset with its bounds, and stiffness of the wall that promises most; None where none does.

    Args:
        place: of the tip, shape (R, 3).
        lever: torques by unit forces there, shape (R, n, 3).
    """
    axes = _axes(place)
    if len(axes) < 2 or np.count_nonzero(np.any(lever, axis=(0, 2))) < 2:
        return None

    def pushes(normal: Array, depths: Array) -> Array:
        height = place @ normal
        depth = np.maximum(height.min() + depths * np.ptp(height) - height[:, None], 0.0)
        return np.asarray((lever @ normal)[:, :, None] * depth[:, None, :] ** 1.5)

    def promise(normal: Array, depths: Array) -> tuple[Array, Array]:
        gain, stiffness = scan.of(pushes(normal, depths))
        return np.where(stiffness > 0, gain, -np.inf), stiffness

    def settled(start: Array, *, turning: bool) -> tuple[float, Array, float]:
        """The best depth from there, and the best normal where it may turn; with what they promise first."""
        gain, _ = promise(start, DEPTHS)
        first, across = float(DEPTHS[int(np.argmax(gain))]), _axes(place, but=start) if turning else []

        def wall(change: Array) -> tuple[Array, float]:
            moved = start + sum((c * axis for c, axis in zip(change[1:], across)), np.zeros(3))
            return moved / np.linalg.norm(moved), float(np.clip(first * np.exp(change[0]), 1e-5, DEEPEST))

        def cost(change: Array) -> float:
            normal, part = wall(change)
            return -max(float(promise(normal, np.array([part]))[0][0]), 0.0)  # one that pulls is none

        best = _least(cost, 1 + len(across))
        return -cost(best), *wall(best)

    rough = []
    for tried in _normals(axes):
        fall, stiffness = scan.roughly(pushes(tried, DEPTHS))
        rough.append((float(np.where(stiffness > 0, fall, 0.0).max()), tried))
    rough.sort(key=lambda item: -item[0])
    best, start = max(
        ((float(promise(tried, DEPTHS)[0].max()), tried) for _, tried in rough[:LOOKED_AT]),
        key=lambda item: item[0],
    )
    if best < PROMISING:
        return None
    tilted, normal, part = settled(start, turning=True)
    upright = max(
        (sign * axis for axis in axes for sign in (1.0, -1.0)), key=lambda axis: float(axis @ normal)
    )
    if upright @ normal > np.cos(NEARLY):
        straight, _, depth = settled(upright, turning=False)
        if tilted < straight * (1.0 + WORTH_TILTING):
            normal, part = upright, depth
    height = place @ normal
    low, way = float(height.min()), float(np.ptp(height))
    size = float(promise(normal, np.array([part]))[1][0])
    return normal, low + part * way, (low, low + DEEPEST * way), size


def _least(cost: Callable[[Array], float], size: int) -> Array:
    start = np.zeros(size)
    simplex = np.vstack([start, FIRST_CHANGE * np.eye(size)])
    options = {"initial_simplex": simplex, "xatol": 1e-3, "fatol": 0.1, "maxfev": 40 * size}
    return np.asarray(minimize(cost, start, method="Nelder-Mead", options=options).x)


def _axes(place: Array, *, but: Array | None = None) -> list[Array]:
    """Orthogonal directions in which the tip moves, inertial axes as far as may be; none along `but`."""
    centred = place - place.mean(axis=0)
    _, sizes, directions = np.linalg.svd(centred.T @ centred)
    moved = directions[np.sqrt(sizes) > FLAT * np.sqrt(sizes[0])]
    within = moved.T @ moved
    found = [] if but is None else [but]
    for axis in sorted(np.eye(3), key=lambda axis: -float(np.linalg.norm(within @ axis))):
        rest = within @ axis
        for other in found:
            rest = rest - (rest @ other) * other
        if np.linalg.norm(rest) > 0.1:
            rest = rest / np.linalg.norm(rest)
            found.append(np.round(rest, 12) + 0.0)
    return found if but is None else found[1:]


def _normals(axes: list[Array]) -> Iterator[Array]:
    """Directions spread over the plane or the space of `axes`, the axes first."""
    for axis in axes:
        yield axis
        yield -axis
    if len(axes) == 2:
        quarter = round(np.pi / 2 / ANGLE)
        for k in range(4 * quarter):
            if k % quarter:
                yield np.cos(k * ANGLE) * axes[0] + np.sin(k * ANGLE) * axes[1]
        return
    for way in product((-1.0, 0.0, 1.0), repeat=3):
        if np.count_nonzero(way) > 1:
            yield np.array(way) / np.linalg.norm(way)
