"""Where to start with what is missing from a base or from links that bend (`passive_changes`)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.passive_fit import PassiveFit, seen
from missing_physics.diagnosis.terms import Term
from reference_model.effects.base import Effect
from reference_model.flexible import flexible_body
from robot_model import Robot

__all__ = ["SEARCHED"]

Array = NDArray[np.float64]
#: Of robot, data, effect, and the likelihood (its logarithm) that others have gained already.
Starts = Callable[[Robot, PassiveFit, Effect, float], Iterator[Term]]

#: Damping ratios added from which fits start.
DAMPINGS = (0.01,)
#: A mode keeps this part of its described damping at least.
LEAST_DAMPED = 0.01
#: Ratio of neighbouring frequencies of a liquid that are tried, the slowest by periods in a recording, and
#: its damping and mass (part of the base's) meanwhile.
RATIO, FEWEST_PERIODS, DAMPING, SHARE = 1.15, 0.8, 0.02, 0.02
#: The highest frequency [Hz].
HIGHEST = 3.0
#: Heaviest liquid as a part of the base, and how far from the base's origin a tank is [m].
HEAVIEST, FARTHEST = 0.8, 5.0
#: Likelihood (its logarithm) that the grid must promise, and as a part of what others have gained already.
PROMISING, WORTH = 10.0, 0.3


def _dampings(robot: Robot, data: PassiveFit, effect: Effect, gained: float) -> Iterator[Term]:
    """Other damping of each link that bends."""
    for link in robot.flexible_links:
        if link.name in robot.known or not _possible(data, effect, link.name):
            continue
        body = flexible_body(link)
        least = float((np.diag(body.damping) / (2 * body.frequencies)).min())
        bounds = -(1.0 - LEAST_DAMPED) * least, effect.parameter("damping_ratio").upper
        for start in DAMPINGS:
            yield Term(effect, link.name, {"damping_ratio": start}, narrowed={"damping_ratio": bounds})


def _wheels(robot: Robot, data: PassiveFit, effect: Effect, gained: float) -> Iterator[Term]:
    """Wheels on a free base. What drag does in a recording a motor's torque does as well."""
    if _possible(data, effect, "base"):
        yield Term(effect, "base", {p.name: p.default or 0.0 for p in effect.parameters}, unseen=("drag",))


def _liquids(robot: Robot, data: PassiveFit, effect: Effect, gained: float) -> Iterator[Term]:
    """A liquid in a free base, about the best of a grid of frequencies."""
    if not _possible(data, effect, "base"):
        return
    best: tuple[float, float, float] | None = None
    mass, errors = SHARE * robot.base.mass, data.errors
    for frequency in _frequencies(data):
        values = {"mass": mass, "frequency": frequency, "damping_ratio": DAMPING, **dict.fromkeys("xyz", 0.0)}
        term = Term(effect, "base", values, unseen=("frequency", "damping_ratio", "mass"))
        parts = []
        for segment, smoother in zip(data.segments, data.smoothers):
            white = smoother.whitened(*seen(segment, term))
            parts.append(white.reshape(-1, white.shape[2]))
        columns = np.concatenate(parts)
        size = np.linalg.norm(columns, axis=0)
        columns = columns / np.where(size > 0, size, 1.0)
        share = np.linalg.lstsq(columns, errors, rcond=1e-4)[0]
        gain = 0.5 * float(errors @ errors - np.sum((errors - columns @ share) ** 2))
        if share[0] > 0 and (best is None or gain > best[0]):
            best = gain, frequency, float(share[0] / size[0])
    if best is None or best[0] < max(PROMISING, WORTH * gained):
        return
    heaviest = HEAVIEST * robot.base.mass
    start = float(np.clip(best[2] * mass, 0.1 * mass, 0.5 * heaviest))
    narrowed: Mapping[str, tuple[float, float]] = {
        "mass": (0.0, heaviest),
        "damping_ratio": (1e-4, 0.5),
        **dict.fromkeys("xyz", (-FARTHEST, FARTHEST)),
    }
    values = {"mass": start, "frequency": best[1], "damping_ratio": DAMPING, **dict.fromkeys("xyz", 0.0)}
    yield Term(effect, "base", values, narrowed=narrowed)


def _frequencies(data: PassiveFit) -> list[float]:
    low = FEWEST_PERIODS / min(float(s.motion.time[-1] - s.motion.time[0]) for s in data.segments)
    count = max(1, int(np.ceil(np.log(HIGHEST / low) / np.log(RATIO))))
    return [float(low * RATIO**k) for k in range(count + 1)]


def _possible(data: PassiveFit, effect: Effect, place: str) -> bool:
    return all(segment.passive.change(effect.id, place) is not None for segment in data.segments)


#: Effects that are looked for, and where fits of each start.
SEARCHED: Mapping[str, Starts] = MappingProxyType(
    {
        "modal_damping": _dampings,
        "reaction_wheel": _wheels,
        "slosh": _liquids,
    }
)
