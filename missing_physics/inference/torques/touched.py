"""Candidates at rigid links: forces that depend on the position of a point of the link, such as walls."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from missing_physics.hypotheses import Candidate, Hypothesis, Term
from missing_physics.inference.ledger import ODDS
from missing_physics.inference.torques.runs import Run
from missing_physics.standard.prediction import knows_links
from reference_model.effects.body_force import BodySight, ForceEffect
from reference_model.effects.catalogue import catalogue
from robot_model import Link, Robot

__all__ = ["at_links"]

Array = NDArray[np.float64]

#: Evenly spaced samples of a recording that are used; a contact over a hundredth of it has ten.
SAMPLES = 1000
#: Most starting values over all links, and the prefix of the names of a direction's components.
STARTS, NORMAL = 4, "normal_"


def at_links(
    robot: Robot, hypothesis: Hypothesis, runs: Sequence[Run], residual: Sequence[Array], sigma: Array
) -> list[Candidate]:
    """Candidates at rigid links, with the starting values that explain most of the residual.

    Args:
        robot: nominal.
        hypothesis: to which effects are added.
        runs: fitted recordings.
        residual: of each recording, zero where nothing is fitted, shape (K, n) [N m or N].
        sigma: rms of the residual at each joint, shape (n,) [N m or N].
    """
    if not knows_links(robot):
        return []
    found: list[tuple[float, Term]] = []
    present = {term.key for term in hypothesis.terms} | {(use.effect, use.at) for use in robot.effects}
    for effect in catalogue().values():
        if not isinstance(effect, ForceEffect) or not effect.along_link:
            continue
        for link in robot.links:
            if (effect.id, link.name) in present or not _is_moved(robot, link):
                continue
            sight = _sight(robot, link, runs, residual, sigma)
            for share, start in effect.starts_along(sight):
                found.append((share, _term(effect, link, start, _room(sight))))
    best = sorted(found, key=lambda one: -one[0])[:STARTS]
    return [Candidate(term) for _, term in best]


def _room(sight: BodySight) -> dict[str, tuple[float, float]]:
    """Bounds of a point on the link and of a plane that it may touch."""
    size = float(np.linalg.norm(sight.points, axis=1).max())
    reach = float(np.linalg.norm(sight.position, axis=1).max()) + size
    return {**dict.fromkeys("xyz", (-size, size)), "offset": (-reach, reach)}


def _term(
    effect: ForceEffect, link: Link, start: Mapping[str, float], room: Mapping[str, tuple[float, float]]
) -> Term:
    """The effect with all parameters that locate it estimated, except the longest component of a normal.

    Each of these parameters could have many values, and costs the prior odds of another effect.
    """
    begin = {p.name: p.absent if p.linear and p.absent is not None else p.typical for p in effect.estimated}
    longest = max((name for name in effect.located if name.startswith(NORMAL)), key=lambda n: abs(start[n]))
    held = {longest: (start[longest], start[longest])}
    odds = ODDS * (len(effect.located) - len(held))
    inside = {p.name: room[p.name] for p in effect.parameters if p.name in room}
    located, limits = frozenset(effect.located), {**inside, **held}
    return Term.of(effect, link.name, {**begin, **start}, limits=limits, further=odds, located=located)


def _is_moved(robot: Robot, link: Link) -> bool:
    return any(joint.child == link.name for joint in robot.joints)


def _points(robot: Robot, link: Link) -> Array:
    """Points of a link that may touch something: its joints, its centre of mass, and its far end, (M, 3)."""
    centre = np.array(link.center_of_mass)
    joints = [j.origin for j in robot.joints if j.parent == link.name]
    return np.array([np.zeros(3), centre, 2.0 * centre, *joints])


def _sight(
    robot: Robot, link: Link, runs: Sequence[Run], residual: Sequence[Array], sigma: Array
) -> BodySight:
    places, turns, spreads, forces = [], [], [], []
    for run, own in zip(runs, residual):
        some = np.arange(len(own))[:: max(len(own) // SAMPLES, 1)]
        place, turn, spread = run.link_at_rows(link.name)
        places.append(place[some])
        turns.append(turn[some])
        spreads.append(spread[some] / sigma[:, None])
        forces.append(-own[some] / sigma)
    return BodySight(
        np.concatenate(places),
        np.concatenate(turns),
        np.concatenate(spreads),
        np.concatenate(forces),
        _points(robot, link),
    )
