"""Starting values of changes of a base or of flexible links (`responses/passive_changes.py`)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.candidates.walls import tip_of
from missing_physics.diagnosis.passive.fit import PassiveFit, seen
from missing_physics.diagnosis.terms.term import Term
from reference_model.effects.base import Effect
from reference_model.effects.catalogue import get_effect
from reference_model.flexible import flexible_body
from robot_model import Robot

__all__ = ["SEARCHED", "liquid_starts", "places", "plain_starts", "run_rivals"]

Array = NDArray[np.float64]
#: Of robot, data, effect, and the likelihood (its logarithm) that others have gained already.
Starts = Callable[[Robot, PassiveFit, Effect, float], Iterator[Term]]

#: Damping ratio added from which fits start.
ADDED = 0.01
#: A mode keeps this part of its described damping at least.
LEAST_DAMPED = 0.01
#: Mass of a load from which fits start, and how much less and more a link may carry, as parts of its own.
CARRIED, LIGHTER, HEAVIER = 0.1, 0.5, 10.0
#: Ratio of neighbouring frequencies of a liquid that are tried, the slowest by periods in a recording, and
#: its damping, as wide as two steps, and mass (part of the base's) meanwhile.
RATIO, FEWEST_PERIODS, WIDE, SHARE = 1.15, 0.8, 0.07, 0.02
#: Damping and masses (parts of the base's) from one of which fits start.
DAMPING, SHARES = 0.02, (0.01, 0.03, 0.1, 0.3)
#: The highest frequency [Hz].
HIGHEST = 3.0
#: Heaviest liquid as a part of the base, and how far from the base's origin a tank is [m].
HEAVIEST, FARTHEST = 0.8, 5.0
#: Likelihood (its logarithm) that the grid must promise, and as a part of what others have gained already.
PROMISING, WORTH = 10.0, 0.3


def plain_starts(robot: Robot) -> Iterator[Term]:
    """Where fits start of effects that take few numbers, from which any start will do."""
    damping, stiffening, wheel = map(
        get_effect, ("modal_damping", "centrifugal_stiffening", "reaction_wheel")
    )
    for link in robot.flexible_links:
        if link.name in robot.known:
            continue
        if link.beam is not None and not link.beam.stiffening:
            yield Term(stiffening, link.name, {"strength": stiffening.parameter("strength").typical})
        body = flexible_body(link)
        least = float((np.diag(body.damping) / (2 * body.frequencies)).min())
        bounds = -(1.0 - LEAST_DAMPED) * least, damping.parameter("damping_ratio").upper
        yield Term(damping, link.name, {"damping_ratio": ADDED}, narrowed={"damping_ratio": bounds})
        yield _carried(robot, link.name)
    if robot.base.kind == "free":
        # what drag does in a recording a motor's torque does as well
        yield Term(wheel, "base", {p.name: p.default or 0.0 for p in wheel.parameters}, unseen=("drag",))


def run_rivals(robot: Robot) -> Mapping[str, tuple[Term, ...]]:
    """What runs may tell as well instead of an effect, by its id: masses elsewhere, and gains of torques."""
    gain, loads = get_effect("torque_gain"), []
    for link in robot.links:
        if not link.flexible and link.name not in robot.known:
            loads.append(_carried(robot, link.name))
    gains = [Term(gain, j.name, {"gain": 1.0}) for j in robot.moving_joints if j.actuator is not None]
    return {"payload": (*loads, *gains)}


def _carried(robot: Robot, name: str) -> Term:
    """A load at the tip of a link."""
    link = robot.link(name)
    if link.flexible:
        body = flexible_body(link)
        mass, (x, y, z) = body.mass, map(float, body.nodes[body.tip])
    else:
        mass, (x, y, z) = link.mass, tip_of(robot, name)
    bounds = {"mass": (-LIGHTER * mass, HEAVIER * mass)}
    values = {"mass": CARRIED * mass, "x": x, "y": y, "z": z}
    return Term(get_effect("payload"), name, values, narrowed=bounds, unseen=("x", "y", "z"))


def liquid_starts(robot: Robot, described: PassiveFit) -> Iterator[Term]:
    """The same of a liquid in a base, where encoders and torques alone tell and links bend."""
    links_bend = all(segment.vibration is not None for segment in described.segments)
    if robot.base.kind == "free" and links_bend:
        yield from _liquids(robot, described, get_effect("slosh"), 0.0)


def places(robot: Robot) -> tuple[tuple[str, str], ...]:
    """Effects that are looked for here and where the robot could have them."""
    found = [term.key for term in plain_starts(robot) if term.effect.id in SEARCHED]
    return (*found, ("slosh", "base")) if robot.base.kind == "free" else tuple(found)


def _plain(robot: Robot, data: PassiveFit, effect: Effect, gained: float) -> Iterator[Term]:
    """Those of one effect that these recordings can show."""
    for term in plain_starts(robot):
        if term.effect.id == effect.id and _possible(data, effect, term.at):
            yield term


def _liquids(robot: Robot, data: PassiveFit, effect: Effect, gained: float) -> Iterator[Term]:
    """A liquid in a free base, about the best of a grid of frequencies."""
    if not _possible(data, effect, "base"):
        return
    best = max((_promise(robot, data, effect, f) for f in _frequencies(data)), key=lambda found: found[0])
    gain, frequency, moment = best
    if gain < max(PROMISING, WORTH * gained):
        return
    heaviest = HEAVIEST * robot.base.mass
    narrowed: Mapping[str, tuple[float, float]] = {
        "mass": (0.0, heaviest),
        "damping_ratio": (1e-4, 0.5),
        **dict.fromkeys("xyz", (-FARTHEST, FARTHEST)),
    }
    trials: list[tuple[float, Term]] = []
    for share in SHARES:
        mass = share * robot.base.mass
        place = dict(zip("xyz", np.clip(moment / mass, -FARTHEST, FARTHEST).tolist()))
        values = {"mass": mass, "frequency": frequency, "damping_ratio": DAMPING, **place}
        term = Term(effect, "base", values, narrowed=narrowed)
        with np.errstate(over="ignore", invalid="ignore"):  # with too much of it the linear motion grows
            likelihood = data.at((*data.terms, term)).likelihood
        if np.isfinite(likelihood):
            trials.append((likelihood, term))
    if trials:
        yield max(trials, key=lambda trial: trial[0])[1]


def _promise(robot: Robot, data: PassiveFit, effect: Effect, frequency: float) -> tuple[float, float, Array]:
    """What a liquid of this frequency can make likelier, the frequency, and mass times place [kg m], (3,).

    What it does is of second order in its place, and to first order proportional to its mass. So it is linear
    in mass, mass times place, and mass times products of two coordinates of the place, here taken for free.
    """
    mass, parts = SHARE * robot.base.mass, []
    for segment, smoother in zip(data.segments, data.smoothers):
        own = []
        for at in np.vstack([np.zeros(3), np.eye(3)]):
            values = {"mass": mass, "frequency": frequency, "damping_ratio": WIDE, **dict(zip("xyz", at))}
            term = Term(effect, "base", values, unseen=("frequency", "damping_ratio", "mass"))
            own.append(np.concatenate(seen(segment, term), axis=1))
        second = [(own[1 + i] - own[0])[:, :, 1 + k] for i in range(3) for k in range(i, 3)]
        columns = np.concatenate([own[0], np.stack(second, axis=2)], axis=2)
        joints = len(segment.joints)
        white = smoother.whitened(columns[:, :joints], columns[:, joints:])
        parts.append(white.reshape(-1, white.shape[2]))
    columns = np.concatenate(parts)
    size = np.linalg.norm(columns, axis=0)
    columns /= np.where(size > 0, size, 1.0)
    share, errors = np.linalg.lstsq(columns, data.errors, rcond=1e-6)[0], data.errors
    gain = 0.5 * float(errors @ errors - np.sum((errors - columns @ share) ** 2))
    return gain, frequency, mass * share[1:4] / np.where(size[1:4] > 0, size[1:4], 1.0)


def _frequencies(data: PassiveFit) -> list[float]:
    low = FEWEST_PERIODS / min(float(s.motion.time[-1] - s.motion.time[0]) for s in data.segments)
    count = max(1, int(np.ceil(np.log(HIGHEST / low) / np.log(RATIO))))
    return [float(low * RATIO**k) for k in range(count + 1)]


def _possible(data: PassiveFit, effect: Effect, place: str) -> bool:
    return all(segment.passive.change(effect.id, place) is not None for segment in data.segments)


#: Effects that are looked for, and where fits of each start.
SEARCHED: Mapping[str, Starts] = MappingProxyType(
    {
        "centrifugal_stiffening": _plain,
        "modal_damping": _plain,
        "reaction_wheel": _plain,
        "slosh": _liquids,
    }
)
