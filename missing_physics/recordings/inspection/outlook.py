"""What can and cannot be identified from a recording, by its channels and its motion."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence

from missing_physics.recordings.channels.estimates import resolution_of
from missing_physics.recordings.channels.names import listed, place_of, quantity_of
from missing_physics.recordings.inspection.excitation import Excitation, excitation
from robot_model import Recording

__all__ = ["outlook"]

#: Samples per period that a visible mode needs.
SAMPLES_PER_PERIOD = 5.0
#: Speed levels (of ten) needed to distinguish a force that grows with speed from one that does not.
ENOUGH_LEVELS = 3
#: Reversals needed to identify effects at reversals.
ENOUGH_REVERSALS = 4
#: More joints than this are called "all joints" if all are concerned.
FEW = 3


def outlook(
    recording: Recording, *, not_judged: Mapping[str, str] | None = None
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Two lists of sentences: what can be identified from the recording, and what cannot and why.

    Args:
        recording: as read.
        not_judged: joints that a diagnosis with a robot cannot judge, with the reason as a sentence.
    """
    moves = excitation(recording)
    judged = [move for move in moves if move.place not in (not_judged or {})]
    every = [move.place for move in moves]
    can = _together(((move.place, words) for move in judged for words in _can(recording, move)), every)
    cannot = [
        *dict.fromkeys((not_judged or {}).values()),
        *_together(((move.place, words) for move in judged for words in _cannot(recording, move)), every),
        *_everywhere(recording, moves),
    ]
    limit = recording.sample_rate / SAMPLES_PER_PERIOD
    can.append(f"vibration up to about {limit:.3g} Hz, at {SAMPLES_PER_PERIOD:g} samples per period.")
    return tuple(can), tuple(cannot)


def _together(sentences: Iterable[tuple[str, str]], every: Sequence[str]) -> list[str]:
    """Merge equal sentences of several joints into one; the joints are not listed if it is `every` one."""
    places: dict[str, list[str]] = {}
    for place, words in sentences:
        places.setdefault(words, []).append(place)
    whole = f"all {len(every)} joints"
    return [
        f"{whole if len(names) == len(every) > FEW else listed(names)}: {words}"
        for words, names in places.items()
    ]


def _force_channel(recording: Recording, place: str) -> str | None:
    names = (f"{place}.{quantity}" for quantity in ("torque", "current", "voltage"))
    return next((name for name in names if name in recording), None)


def _can(recording: Recording, move: Excitation) -> Iterator[str]:
    place, force = move.place, _force_channel(recording, move.place)
    if not move.moves or move.trembles or force is None:
        return
    yield f"the force that resists the motion, from the {quantity_of(force)} that drives it."
    if move.speed_levels >= ENOUGH_LEVELS and move.both_directions:
        yield "viscous friction, Coulomb friction and an offset, each by itself."
    if move.reversals >= ENOUGH_REVERSALS:
        yield f"effects at reversals ({move.reversals} of them)."
    if f"{place}.position" in recording and f"{place}.motor_position" in recording:
        yield "the gear between motor and joint (elasticity, backlash, transmission error)."


def _cannot(recording: Recording, move: Excitation) -> Iterator[str]:
    place = move.place
    if not move.moves:
        yield "nothing, since there is no motion beyond the noise."
        return
    if move.trembles:
        yield "friction, since the joint only trembles while another joint moves."
        return
    if _force_channel(recording, place) is None:
        yield ("masses and forces, since no torque, current or voltage is recorded; only their ratios show.")
    if not move.both_directions:
        yield "an offset separately from dry friction, since all motion is in one direction."
    if move.speed_levels < ENOUGH_LEVELS:
        yield "viscous friction separately from dry friction, since there is about one speed."
    if move.reversals < ENOUGH_REVERSALS:
        yield f"backlash, presliding and stiction, since there {_reversals(move.reversals)}."
    if not {f"{place}.position", f"{place}.motor_position"} <= set(recording):
        yield "the gear between motor and joint, except by its resonance, since only one side is recorded."
    if f"{place}.temperature" not in recording:
        yield "dependence on temperature, since none is recorded."
    step = resolution_of(recording, f"{place}.position") if f"{place}.position" in recording else 0.0
    if step:
        yield f"motion finer than {step:.3g}, the step of the position."


def _reversals(count: int) -> str:
    return {0: "is no reversal", 1: "is one reversal only"}.get(count, f"are {count} reversals only")


def _everywhere(recording: Recording, moves: tuple[Excitation, ...]) -> Iterator[str]:
    places = {place_of(name) for name in recording}
    quantities = {quantity_of(name) for name in recording}
    if not moves:
        yield "joint physics, since no joint's position is recorded."
    if "base" not in places:
        yield "motion of the base, since no base channel is recorded; that it is fixed cannot be checked."
    if not quantities & {"tip_acceleration", "tip_deflection", "strain"}:
        yield (
            "flexibility of the links beyond what reaches the joints, since no tip or strain "
            "sensor is recorded."
        )
